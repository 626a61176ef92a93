// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ros2/participant.hpp"

#include <dds/ddsi/ddsi_keyhash.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <new>
#include <utility>

namespace terrainseg::ros2 {
namespace {

// A type without description for Cyclone DDS: messages are passed as serialized bytes. It implements DDSI's
// interface for types: sertype is a type, serdata a message. Its functions are called from C and must not
// throw. When memory is exhausted they return nullptr, which Cyclone DDS handles as a lost message.

/// One message. Its bytes follow, padded with zeros to a multiple of 4 as the protocol requires.
struct RawData : ddsi_serdata {
  std::uint32_t size;
  std::uint8_t* bytes() { return reinterpret_cast<std::uint8_t*>(this + 1); }
  const std::uint8_t* bytes() const { return reinterpret_cast<const std::uint8_t*>(this + 1); }
};

const RawData& raw(const ddsi_serdata* data) {
  return *static_cast<const RawData*>(data);
}

RawData* new_data(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size) {
  const std::size_t words = (size + 3) & ~std::size_t{3};
  if (words < size || words > UINT32_MAX - sizeof(RawData))
    return nullptr;
  void* memory = std::calloc(1, sizeof(RawData) + words);
  if (!memory)
    return nullptr;
  auto* data = new (memory) RawData;
  ddsi_serdata_init(data, type, kind);
  data->hash = type->serdata_basehash; // a type without a key has one instance
  data->size = static_cast<std::uint32_t>(size);
  return data;
}

ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment,
                             std::size_t size) {
  RawData* data = new_data(type, kind, size);
  if (!data)
    return nullptr;
  std::size_t done = 0;
  for (; fragment; fragment = fragment->nextfrag) { // fragments may overlap
    if (fragment->maxp1 <= done || fragment->min > done)
      continue;
    const std::size_t end = std::min<std::size_t>(fragment->maxp1, size);
    const unsigned char* payload = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
    std::memcpy(data->bytes() + done, payload + (done - fragment->min), end - done);
    done = end;
    if (done == size)
      return data;
  }
  ddsi_serdata_unref(data);
  return nullptr;
}

ddsi_serdata* from_parts(const ddsi_sertype* type, ddsi_serdata_kind kind, ddsrt_msg_iovlen_t count,
                         const ddsrt_iovec_t* parts, std::size_t size) {
  RawData* data = new_data(type, kind, size);
  std::size_t done = 0;
  for (ddsrt_msg_iovlen_t i = 0; data && i < count; ++i) {
    const std::size_t length = std::min<std::size_t>(parts[i].iov_len, size - done);
    std::memcpy(data->bytes() + done, parts[i].iov_base, length);
    done += length;
  }
  return data;
}

ddsi_serdata* refer(const ddsi_serdata* data, std::size_t offset, std::size_t size, ddsrt_iovec_t* part) {
  part->iov_base = const_cast<std::uint8_t*>(raw(data).bytes()) + offset;
  part->iov_len = size;
  return ddsi_serdata_ref(data);
}

ddsi_serdata* to_untyped(const ddsi_serdata* data) {
  RawData* key = new_data(data->type, SDK_KEY, 0);
  if (key)
    key->type = nullptr;
  return key;
}

const ddsi_serdata_ops data_operations = [] {
  ddsi_serdata_ops ops{};
  ops.eqkey = [](const ddsi_serdata*, const ddsi_serdata*) { return true; };
  ops.get_size = [](const ddsi_serdata* data) { return raw(data).size; };
  ops.from_ser = from_fragments;
  ops.from_ser_iov = from_parts;
  ops.from_keyhash = [](const ddsi_sertype* type, const ddsi_keyhash*) -> ddsi_serdata* {
    return new_data(type, SDK_KEY, 0);
  };
  // Messages are written and read as bytes only.
  ops.from_sample = [](const ddsi_sertype*, ddsi_serdata_kind, const void*) -> ddsi_serdata* {
    return nullptr;
  };
  ops.to_sample = [](const ddsi_serdata*, void*, void**, void*) { return false; };
  ops.untyped_to_sample = [](const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) {
    return false;
  };
  ops.to_ser = [](const ddsi_serdata* data, std::size_t offset, std::size_t size, void* into) {
    std::memcpy(into, raw(data).bytes() + offset, size);
  };
  ops.to_ser_ref = refer;
  ops.to_ser_unref = [](ddsi_serdata* data, const ddsrt_iovec_t*) { ddsi_serdata_unref(data); };
  ops.to_untyped = to_untyped;
  ops.free = [](ddsi_serdata* data) { std::free(static_cast<RawData*>(data)); };
  ops.print = [](const ddsi_sertype*, const ddsi_serdata*, char* text, std::size_t size) -> std::size_t {
    if (size > 0)
      text[0] = 0;
    return 0;
  };
  ops.get_keyhash = [](const ddsi_serdata*, ddsi_keyhash* hash, bool) { std::memset(hash, 0, sizeof *hash); };
  return ops;
}();

const ddsi_sertype_ops type_operations = [] {
  ddsi_sertype_ops ops{};
  ops.version = ddsi_sertype_v0;
  ops.free = [](ddsi_sertype* type) {
    ddsi_sertype_fini(type);
    std::free(type);
  };
  ops.zero_samples = [](const ddsi_sertype*, void*, std::size_t) {};
  ops.realloc_samples = [](void** samples, const ddsi_sertype*, void*, std::size_t, std::size_t count) {
    std::fill_n(samples, count, nullptr);
  };
  ops.free_samples = [](const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {};
  ops.equal = [](const ddsi_sertype*, const ddsi_sertype*) { return true; }; // names are compared before
  ops.hash = [](const ddsi_sertype*) -> std::uint32_t { return 0; };
  return ops;
}();

/// The entity; throws if it is an error code of DDS.
dds_entity_t checked(dds_entity_t entity, const std::string& failure) {
  if (entity < 0)
    throw Problem(failure + ": " + dds_strretcode(entity));
  return entity;
}

using Qos = std::unique_ptr<dds_qos_t, decltype([](dds_qos_t* qos) { dds_delete_qos(qos); })>;
using Listener = std::unique_ptr<dds_listener_t,
                                 decltype([](dds_listener_t* listener) { dds_delete_listener(listener); })>;

/// The user data of an endpoint that ROS 2 announces since Iron.
std::string user_data_of(const recording::MessageType& type) {
  return "typehash=" + type.hash + ";";
}

} // namespace

RawTopic create_raw_topic(dds_entity_t participant, const std::string& name, const std::string& type_name) {
  auto* type = static_cast<ddsi_sertype*>(std::calloc(1, sizeof(ddsi_sertype)));
  if (!type)
    return {DDS_RETCODE_OUT_OF_RESOURCES, nullptr};
  ddsi_sertype_init_flags(type, type_name.c_str(), &type_operations, &data_operations,
                          DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  const dds_entity_t topic =
      dds_create_topic_sertype(participant, name.c_str(), &type, nullptr, nullptr, nullptr);
  if (topic < 0)
    ddsi_sertype_unref(type);
  return {topic, topic < 0 ? nullptr : type};
}

bool take_raw(dds_entity_t reader, recording::Bytes& message, std::size_t longest) {
  ddsi_serdata* data = nullptr;
  dds_sample_info_t info;
  if (dds_takecdr(reader, &data, 1, &info, DDS_ANY_STATE) <= 0)
    return false;
  message.clear();
  if (info.valid_data && data->kind == SDK_DATA && raw(data).size <= longest)
    message.assign(raw(data).bytes(), raw(data).bytes() + raw(data).size);
  ddsi_serdata_unref(data);
  return true;
}

/// If other code of the process has already created the domain, it is used as it is.
class Domain {
 public:
  explicit Domain(const Discovery& discovery) : id_(discovery.domain) {
    const std::lock_guard lock(mutex);
    Made& made = domains[id_];
    if (made.users == 0) {
      const char* own = std::getenv("CYCLONEDDS_URI"); // later parts have priority
      const std::string config = cyclone_config(discovery) + "," + (own ? own : "");
      made.entity = dds_create_domain(id_, config.c_str());
      if (made.entity != DDS_RETCODE_PRECONDITION_NOT_MET)
        checked(made.entity, "Cyclone DDS cannot use domain " + std::to_string(id_));
    }
    ++made.users;
  }
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

Participant::Participant(const Discovery& discovery, bool enclave)
    : domain_(std::make_unique<Domain>(discovery)) {
  const Qos qos(dds_create_qos());
  constexpr std::string_view root = "enclave=/;";
  if (enclave)
    dds_qset_userdata(qos.get(), root.data(), root.size());
  entity_ = checked(dds_create_participant(discovery.domain, qos.get(), nullptr),
                    "Cyclone DDS cannot join domain " + std::to_string(discovery.domain));
}

// The participant must be destroyed before its domain.
Participant::~Participant() {
  dds_delete(entity_);
}

Writer::Writer(const Participant& participant, const std::string& topic, const recording::MessageType& type,
               Durability durability, int depth)
    : Writer(participant, dds_topic(topic), type.name, user_data_of(type), durability, depth) {}

Writer::Writer(const Participant& participant)
    : Writer(participant, "ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo", "",
             Durability::transient_local, 1) {}

Writer::Writer(const Participant& participant, const std::string& topic, const std::string& type,
               const std::string& user_data, Durability durability, int depth)
    : Endpoint(participant, topic, type) {
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
  entity_ = checked(topic_.entity < 0
                        ? topic_.entity
                        : dds_create_writer(participant.entity(), topic_.entity, qos.get(), listener.get()),
                    "Cyclone DDS cannot write a topic");
}

Endpoint::Endpoint(const Participant& participant, const std::string& topic, const std::string& type)
    : topic_(create_raw_topic(participant.entity(), topic, dds_type(type))) {}

void Endpoint::close() {
  for (dds_entity_t* entity : {&entity_, &topic_.entity})
    if (*entity > 0)
      dds_delete(std::exchange(*entity, 0)); // waits for a running listener
}

bool Writer::write(recording::ByteView message) {
  RawData* data = new_data(topic_.type, SDK_DATA, message.size());
  if (data)
    std::copy(message.begin(), message.end(), data->bytes());
  // NOLINTNEXTLINE(clang-analyzer-unix.Malloc): dds_writecdr takes the reference
  const bool taken = data && dds_writecdr(entity_, data) == DDS_RETCODE_OK;
  ++(taken ? written_ : dropped_);
  return taken;
}

Reader::Reader(const Participant& participant, const std::string& topic, const recording::MessageType& type,
               std::size_t longest, OnMessage on_message)
    : Endpoint(participant, dds_topic(topic), type.name), longest_(longest),
      on_message_(std::move(on_message)) {
  const Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 32);
  const std::string user_data = user_data_of(type);
  dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  const Listener listener(dds_create_listener(this));
  dds_lset_data_available(
      listener.get(), [](dds_entity_t reader, void* self) { static_cast<Reader*>(self)->take_all(reader); });
  entity_ = checked(topic_.entity < 0
                        ? topic_.entity
                        : dds_create_reader(participant.entity(), topic_.entity, qos.get(), listener.get()),
                    "Cyclone DDS cannot read the topic " + topic);
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
    recording::Bytes gid(std::begin(guid.v), std::end(guid.v));
    gid.resize(gid_size);
    out.raw(gid);
  };
  put_gid(participant.entity());
  out.count(1); // node_entities_info_seq
  out.put(name_space, node);
  for (const auto* entities : {&readers, &writers}) {
    out.count(entities->size());
    for (const dds_entity_t entity : *entities)
      put_gid(entity);
  }
  return message;
}

} // namespace terrainseg::ros2
