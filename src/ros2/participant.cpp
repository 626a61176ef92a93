// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ros2/participant.hpp"

#include <cstdlib>
#include <map>
#include <mutex>
#include <utility>

#include "recording/cdr.hpp"
#include "ros2/names.hpp"

namespace terrainseg::ros2 {
namespace {

std::string failed(const std::string& what, dds_return_t code) {
  return what + ": " + dds_strretcode(code);
}

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, QosDeleter>;

struct ListenerDeleter {
  void operator()(dds_listener_t* listener) const { dds_delete_listener(listener); }
};
using Listener = std::unique_ptr<dds_listener_t, ListenerDeleter>;

/// The user data of an endpoint that ROS 2 announces since Iron.
std::string user_data_of(const recording::MessageType& type) {
  return "typehash=" + type_hash(type) + ";";
}

} // namespace

/// If other code of the process has already created the domain, it is used as it is.
class Domain {
 public:
  static std::shared_ptr<Domain> use(const Discovery& discovery, std::string& error) {
    const std::lock_guard lock(mutex);
    Made& made = domains[discovery.domain];
    if (made.users == 0) {
      const char* own = std::getenv("CYCLONEDDS_URI"); // later parts have priority
      const std::string config = cyclone_config(discovery) + "," + (own ? own : "");
      made.entity = dds_create_domain(discovery.domain, config.c_str());
      if (made.entity < 0 && made.entity != DDS_RETCODE_PRECONDITION_NOT_MET) {
        error = failed("Cyclone DDS cannot use domain " + std::to_string(discovery.domain), made.entity);
        return nullptr;
      }
    }
    ++made.users;
    return std::make_shared<Domain>(discovery.domain);
  }
  explicit Domain(std::uint32_t id) : id_(id) {}
  ~Domain() {
    const std::lock_guard lock(mutex);
    Made& made = domains[id_];
    if (--made.users == 0 && made.entity > 0)
      dds_delete(made.entity);
  }
  Domain(const Domain&) = delete;
  Domain& operator=(const Domain&) = delete;

 private:
  struct Made {
    dds_entity_t entity = 0; ///< negative = another user of Cyclone DDS created the domain
    int users = 0;
  };
  const std::uint32_t id_;
  static inline std::mutex mutex;
  static inline std::map<std::uint32_t, Made> domains;
};

std::unique_ptr<Participant> Participant::join(const Discovery& discovery, bool enclave, std::string& error) {
  std::shared_ptr<Domain> domain = Domain::use(discovery, error);
  if (!domain)
    return nullptr;
  const Qos qos(dds_create_qos());
  constexpr std::string_view root = "enclave=/;";
  if (enclave)
    dds_qset_userdata(qos.get(), root.data(), root.size());
  const dds_entity_t entity = dds_create_participant(discovery.domain, qos.get(), nullptr);
  if (entity < 0) {
    error = failed("Cyclone DDS cannot join domain " + std::to_string(discovery.domain), entity);
    return nullptr;
  }
  return std::unique_ptr<Participant>(new Participant(std::move(domain), entity));
}

Participant::Participant(std::shared_ptr<Domain> domain, dds_entity_t entity)
    : domain_(std::move(domain)), entity_(entity) {}

// The participant must be destroyed before its domain.
Participant::~Participant() {
  dds_delete(entity_);
}

Writer::Writer(const Participant& participant, const std::string& topic, const recording::MessageType& type,
               Durability durability, int depth)
    : topic_(create_raw_topic(participant.entity(), dds_topic(topic), dds_type(type.name))) {
  open(participant, durability, depth, user_data_of(type));
}

Writer::Writer(const Participant& participant)
    : topic_(create_raw_topic(participant.entity(), "ros_discovery_info",
                              dds_type("rmw_dds_common/msg/ParticipantEntitiesInfo"))) {
  open(participant, Durability::transient_local, 1, "");
}

void Writer::open(const Participant& participant, Durability durability, int depth,
                  const std::string& user_data) {
  const Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_MSECS(5));
  dds_qset_durability(qos.get(), durability == Durability::transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL
                                                                           : DDS_DURABILITY_VOLATILE);
  if (durability == Durability::transient_local)
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  const Listener listener(dds_create_listener(this));
  dds_lset_publication_matched(listener.get(),
                               [](dds_entity_t, dds_publication_matched_status_t status, void* self) {
                                 static_cast<Writer*>(self)->readers_ = status.current_count;
                               });
  entity_ = topic_.entity < 0
                ? topic_.entity
                : dds_create_writer(participant.entity(), topic_.entity, qos.get(), listener.get());
  if (entity_ < 0)
    error_ = failed("Cyclone DDS cannot write a topic", entity_);
}

Writer::~Writer() {
  if (entity_ > 0)
    dds_delete(entity_);
  if (topic_.entity > 0)
    dds_delete(topic_.entity);
}

bool Writer::write(recording::ByteView message) {
  const bool taken = write_raw(entity_, topic_, message) == DDS_RETCODE_OK;
  ++(taken ? written_ : dropped_);
  return taken;
}

Reader::Reader(const Participant& participant, const std::string& topic, const recording::MessageType& type,
               std::size_t longest, OnMessage on_message)
    : topic_(create_raw_topic(participant.entity(), dds_topic(topic), dds_type(type.name))),
      longest_(longest), on_message_(std::move(on_message)) {
  const Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 32);
  const std::string user_data = user_data_of(type);
  dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  const Listener listener(dds_create_listener(this));
  dds_lset_data_available(
      listener.get(), [](dds_entity_t reader, void* self) { static_cast<Reader*>(self)->take_all(reader); });
  entity_ = topic_.entity < 0
                ? topic_.entity
                : dds_create_reader(participant.entity(), topic_.entity, qos.get(), listener.get());
  if (entity_ < 0)
    error_ = failed("Cyclone DDS cannot read the topic " + topic, entity_);
}

Reader::~Reader() {
  if (entity_ > 0)
    dds_delete(entity_); // waits for a running listener
  if (topic_.entity > 0)
    dds_delete(topic_.entity);
}

void Reader::take_all(dds_entity_t reader) {
  while (take_raw(reader, message_, longest_))
    on_message_(message_);
}

recording::Bytes participant_entities(const Participant& participant, std::size_t gid_size,
                                      const std::string& name_space, const std::string& node,
                                      const std::vector<dds_entity_t>& readers,
                                      const std::vector<dds_entity_t>& writers) {
  recording::Bytes message;
  recording::CdrWriter out(message);
  const auto put_gid = [&](dds_entity_t entity) { // rmw_dds_common/msg/Gid
    dds_guid_t guid{};
    dds_get_guid(entity, &guid);
    for (const std::uint8_t byte : guid.v)
      out.u8(byte);
    for (std::size_t i = sizeof guid.v; i < gid_size; ++i)
      out.u8(0);
  };
  put_gid(participant.entity());
  out.count(1); // node_entities_info_seq
  out.string(name_space);
  out.string(node);
  for (const auto* entities : {&readers, &writers}) {
    out.count(entities->size());
    for (const dds_entity_t entity : *entities)
      put_gid(entity);
  }
  return message;
}

} // namespace terrainseg::ros2
