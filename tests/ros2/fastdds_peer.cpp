// SPDX-License-Identifier: LGPL-2.1-or-later
// A program on Fast DDS, the other implementation of DDS, for tests/ci/ros2.sh: it reads a topic into a file
// or writes poses. It knows a type by name only, as the sink does.
//
// fastdds_peer read DOMAIN TOPIC TYPE SECONDS FILE [best-effort | late]
//   messages, each behind its length (4 bytes), for SECONDS from the first on, PATIENCE seconds (environment,
//   60) without any; says how many
// fastdds_peer pose DOMAIN TOPIC SECONDS [hostile]
//   geometry_msgs/msg/PoseStamped, 20 a second, pitch 0.1; with `hostile` before each one that is cut, one
//   that is big-endian and one of 1 MB
// fastdds_peer compare RECORDING.mcap TOPIC FILE LEAST [late]
//   each message of FILE is one of the recording, at most one again, and LEAST percent of those from the
//   first to the last are there; with `late` from the second, as the first was kept for late readers
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "../support/mcap_messages.hpp"

namespace {

namespace dds = eprosima::fastdds::dds;
using Message = terrainseg::test::Payload;

#if __has_include(<fastrtps/fastrtps_dll.h>) // Fast DDS 2
namespace rtps = eprosima::fastrtps::rtps;
const auto code_ok = eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
#else
namespace rtps = eprosima::fastdds::rtps;
const auto code_ok = dds::RETCODE_OK;
#endif

bool put(const void* data, rtps::SerializedPayload_t& payload) {
  const auto& message = *static_cast<const Message*>(data);
  std::memcpy(payload.data, message.data(), message.size());
  payload.length = static_cast<std::uint32_t>(message.size());
  payload.encapsulation = CDR_LE;
  return true;
}

bool take(const rtps::SerializedPayload_t& payload, void* data) {
  static_cast<Message*>(data)->assign(payload.data, payload.data + payload.length);
  return true;
}

std::uint32_t size_of(const void* data) {
  return static_cast<std::uint32_t>(static_cast<const Message*>(data)->size());
}

constexpr std::uint32_t largest = 4 << 20;

class RawType : public dds::TopicDataType {
 public:
#if __has_include(<fastrtps/fastrtps_dll.h>)
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = largest;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    return put(data, *payload);
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    return take(*payload, data);
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return size_of(data); };
  }
  void* createData() override {
    return new Message;
  }
  void deleteData(void* data) override {
    delete static_cast<Message*>(data);
  }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override {
    return false;
  }
#else
  explicit RawType(const std::string& name) {
    set_name(name);
    max_serialized_type_size = largest;
  }
  bool serialize(const void* data, rtps::SerializedPayload_t& payload, dds::DataRepresentationId_t) override {
    return put(data, payload);
  }
  bool deserialize(rtps::SerializedPayload_t& payload, void* data) override {
    return take(payload, data);
  }
  std::uint32_t calculate_serialized_size(const void* data, dds::DataRepresentationId_t) override {
    return size_of(data);
  }
  void* create_data() override {
    return new Message;
  }
  void delete_data(void* data) override {
    delete static_cast<Message*>(data);
  }
  bool compute_key(rtps::SerializedPayload_t&, rtps::InstanceHandle_t&, bool) override {
    return false;
  }
  bool compute_key(const void*, rtps::InstanceHandle_t&, bool) override {
    return false;
  }
#endif
};

/// A participant with one topic, as a node of ROS 2 has it.
struct Node {
  Node(unsigned domain, const std::string& topic_name, const std::string& type_name) {
    participant = dds::DomainParticipantFactory::get_instance()->create_participant(
        domain, dds::PARTICIPANT_QOS_DEFAULT);
    dds::TypeSupport type(new RawType(type_name));
    type.register_type(participant);
    topic = participant->create_topic(topic_name, type_name, dds::TOPIC_QOS_DEFAULT);
  }
  dds::DomainParticipant* participant = nullptr;
  dds::Topic* topic = nullptr;
};

using Clock = std::chrono::steady_clock;

int read(unsigned domain, const char* topic, const char* type, double seconds, const char* file,
         const std::string& quality) {
  Node node(domain, topic, type);
  dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
  qos.reliability().kind =
      quality == "best-effort" ? dds::BEST_EFFORT_RELIABILITY_QOS : dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind =
      quality == "late" ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 100;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  dds::DataReader* reader =
      node.participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)->create_datareader(node.topic, qos);
  std::ofstream out(file, std::ios::binary);
  const char* patience = std::getenv("PATIENCE");
  auto end = Clock::now() + std::chrono::duration<double>(patience ? std::atof(patience) : 60);
  int count = 0;
  while (Clock::now() < end) {
    reader->wait_for_unread_message({0, 100'000'000});
    Message message;
    dds::SampleInfo info;
    while (reader->take_next_sample(&message, &info) == code_ok)
      if (info.valid_data) {
        if (count == 0)
          end = Clock::now() + std::chrono::duration<double>(seconds);
        const auto size = static_cast<std::uint32_t>(message.size());
        out.write(reinterpret_cast<const char*>(&size), 4);
        out.write(reinterpret_cast<const char*>(message.data()), size);
        ++count;
      }
  }
  out.close();
  std::printf("%d\n", count);
  std::fflush(stdout);
  std::_Exit(0); // leaves as a killed node does
}

int write_poses(unsigned domain, const char* topic, double seconds, bool hostile) {
  Node node(domain, topic, "geometry_msgs::msg::dds_::PoseStamped_");
  dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  dds::DataWriter* writer =
      node.participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT)->create_datawriter(node.topic, qos);
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (Clock::now() < end) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const auto nanoseconds = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
    const auto sec = static_cast<std::int32_t>(nanoseconds / 1'000'000'000);
    const auto nanosec = static_cast<std::uint32_t>(nanoseconds % 1'000'000'000);
    // Header (stamp, "odom"), 3 bytes to the next multiple of 8, position, orientation.
    Message message = {0, 1, 0, 0};
    message.resize(4 + 24 + 56);
    const std::uint32_t length = 5;
    std::memcpy(&message[4], &sec, 4);
    std::memcpy(&message[8], &nanosec, 4);
    std::memcpy(&message[12], &length, 4);
    std::memcpy(&message[16], "odom", 5);
    const double pitch = 0.1, values[] = {0, 0, 0, 0, std::sin(pitch / 2), 0, std::cos(pitch / 2)};
    std::memcpy(&message[28], values, sizeof values);
    if (hostile) {
      Message cut(message.begin(), message.end() - 1), big_endian = message, large = message;
      big_endian[1] = 0;
      large.resize(1 << 20);
      for (Message* each : {&cut, &big_endian, &large})
        writer->write(each);
    }
    writer->write(&message);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  std::_Exit(0);
}

std::string contents(const char* path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Equal, but for up to three bytes that fill the message up.
bool same(const Message& received, const Message& recorded) {
  return received.size() >= recorded.size() && received.size() < recorded.size() + 4 &&
         std::equal(recorded.begin(), recorded.end(), received.begin());
}

/// How a message differs from the recorded one that is most like it.
void describe(const Message& message, const std::vector<Message>& recorded) {
  std::size_t least = SIZE_MAX, nearest = 0, first = 0, last = 0;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    std::size_t differences = 0, from = 0, to = 0;
    for (std::size_t at = 0; at < std::min(message.size(), recorded[i].size()); ++at)
      if (message[at] != recorded[i][at]) {
        from = differences == 0 ? at : from;
        to = at;
        ++differences;
      }
    if (differences < least)
      least = differences, nearest = i, first = from, last = to;
  }
  std::printf("other bytes: %zu bytes, most like number %zu of %zu bytes, from which %zu bytes from %zu to "
              "%zu differ\n",
              message.size(), nearest, recorded.empty() ? 0 : recorded[nearest].size(), least, first, last);
}

int compare(const char* recording, const char* topic, const char* file, double least, bool late) {
  const std::vector<Message> recorded = terrainseg::test::mcap_messages(contents(recording))[topic];
  const std::string bytes = contents(file);
  std::size_t received = 0, at = 0, first = 0, other = 0, again = 0, kept = 0, empty = 0;
  for (std::size_t i = 0; i + 4 <= bytes.size();) {
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data() + i, 4);
    const Message message(bytes.begin() + static_cast<std::ptrdiff_t>(i + 4),
                          bytes.begin() + static_cast<std::ptrdiff_t>(i + 4 + size));
    i += 4 + size;
    // Fast DDS 2.9 sometimes delivers a sample without bytes to a reader that stood still while fragments
    // came (1 of 4 tries): a message that was lost.
    if (message.empty()) {
      ++empty;
      continue;
    }
    std::size_t found = at;
    while (found < recorded.size() && !same(message, recorded[found]))
      ++found;
    if (found == recorded.size()) {
      const bool before = std::any_of(recorded.begin(), recorded.begin() + static_cast<std::ptrdiff_t>(at),
                                      [&](const Message& one) { return same(message, one); });
      ++(before ? again : other);
      if (!before)
        describe(message, recorded);
      continue;
    }
    if (late && kept == 0) {
      kept = 1;
      at = found + 1;
      continue;
    }
    first = received == 0 ? found : first;
    at = found + 1;
    ++received;
  }
  const std::size_t sent = received > 0 ? at - first : 0;
  const double percent = sent > 0 ? 100.0 * static_cast<double>(received) / static_cast<double>(sent) : 0;
  std::printf("%s: %zu of %zu messages from the first to the last (%.1f %%), %zu again or late, %zu with "
              "other bytes, "
              "%zu recorded\n",
              topic, received, sent, percent, again, other, recorded.size());
  if (empty > 0)
    std::printf("%zu messages without bytes, which count as lost\n", empty);
  return other == 0 && again <= 1 && percent >= least ? 0 : 1;
}

} // namespace

int main(int argc, char** argv) {
  const std::string mode = argc > 1 ? argv[1] : "";
  const auto number = [&](int i) { return std::atof(argv[i]); };
  if (mode == "read" && argc >= 7)
    return read(static_cast<unsigned>(number(2)), argv[3], argv[4], number(5), argv[6],
                argc > 7 ? argv[7] : "");
  if (mode == "pose" && argc >= 5)
    return write_poses(static_cast<unsigned>(number(2)), argv[3], number(4), argc > 5);
  if (mode == "compare" && argc >= 6)
    return compare(argv[2], argv[3], argv[4], number(5), argc > 6);
  std::fprintf(stderr, "fastdds_peer: see the head of its source\n");
  return 2;
}
