// SPDX-License-Identifier: LGPL-2.1-or-later
// Implements DDSI's interface for types: sertype is a type, serdata a message. Its functions are called from
// C and must not throw. When memory is exhausted they return nullptr, which Cyclone DDS handles as a lost
// message.
#include "ros2/raw_type.hpp"

#include <dds/ddsi/ddsi_keyhash.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <new>

namespace terrainseg::ros2 {
namespace {

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

bool have_equal_keys(const ddsi_serdata*, const ddsi_serdata*) {
  return true;
}

std::uint32_t size_of(const ddsi_serdata* data) {
  return raw(data).size;
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

ddsi_serdata* from_keyhash(const ddsi_sertype* type, const ddsi_keyhash*) {
  return new_data(type, SDK_KEY, 0);
}

ddsi_serdata* from_sample(const ddsi_sertype*, ddsi_serdata_kind, const void*) {
  return nullptr; // messages are written as bytes only
}

void copy_out(const ddsi_serdata* data, std::size_t offset, std::size_t size, void* into) {
  std::memcpy(into, raw(data).bytes() + offset, size);
}

ddsi_serdata* refer(const ddsi_serdata* data, std::size_t offset, std::size_t size, ddsrt_iovec_t* part) {
  part->iov_base = const_cast<std::uint8_t*>(raw(data).bytes()) + offset;
  part->iov_len = size;
  return ddsi_serdata_ref(data);
}

void unrefer(ddsi_serdata* data, const ddsrt_iovec_t*) {
  ddsi_serdata_unref(data);
}

bool to_sample(const ddsi_serdata*, void*, void**, void*) {
  return false;
}

ddsi_serdata* to_untyped(const ddsi_serdata* data) {
  RawData* key = new_data(data->type, SDK_KEY, 0);
  if (key)
    key->type = nullptr;
  return key;
}

bool untyped_to_sample(const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) {
  return false;
}

void free_data(ddsi_serdata* data) {
  std::free(static_cast<RawData*>(data));
}

std::size_t print(const ddsi_sertype*, const ddsi_serdata*, char* text, std::size_t size) {
  if (size > 0)
    text[0] = 0;
  return 0;
}

void get_keyhash(const ddsi_serdata*, ddsi_keyhash* hash, bool) {
  std::memset(hash, 0, sizeof *hash);
}

const ddsi_serdata_ops& data_operations() {
  static const ddsi_serdata_ops operations = [] {
    ddsi_serdata_ops ops{};
    ops.eqkey = have_equal_keys;
    ops.get_size = size_of;
    ops.from_ser = from_fragments;
    ops.from_ser_iov = from_parts;
    ops.from_keyhash = from_keyhash;
    ops.from_sample = from_sample;
    ops.to_ser = copy_out;
    ops.to_ser_ref = refer;
    ops.to_ser_unref = unrefer;
    ops.to_sample = to_sample;
    ops.to_untyped = to_untyped;
    ops.untyped_to_sample = untyped_to_sample;
    ops.free = free_data;
    ops.print = print;
    ops.get_keyhash = get_keyhash;
    return ops;
  }();
  return operations;
}

void free_type(ddsi_sertype* type) {
  ddsi_sertype_fini(type);
  std::free(type);
}

const ddsi_sertype_ops& type_operations() {
  static const ddsi_sertype_ops operations = [] {
    ddsi_sertype_ops ops{};
    ops.version = ddsi_sertype_v0;
    ops.free = free_type;
    ops.zero_samples = [](const ddsi_sertype*, void*, std::size_t) {};
    ops.realloc_samples = [](void** samples, const ddsi_sertype*, void*, std::size_t, std::size_t count) {
      std::fill_n(samples, count, nullptr);
    };
    ops.free_samples = [](const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {};
    ops.equal = [](const ddsi_sertype*, const ddsi_sertype*) { return true; }; // names are compared before
    ops.hash = [](const ddsi_sertype*) -> std::uint32_t { return 0; };
    return ops;
  }();
  return operations;
}

} // namespace

RawTopic create_raw_topic(dds_entity_t participant, const std::string& name, const std::string& type_name) {
  auto* type = static_cast<ddsi_sertype*>(std::calloc(1, sizeof(ddsi_sertype)));
  if (!type)
    return {DDS_RETCODE_OUT_OF_RESOURCES, nullptr};
  ddsi_sertype_init_flags(type, type_name.c_str(), &type_operations(), &data_operations(),
                          DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  const dds_entity_t topic =
      dds_create_topic_sertype(participant, name.c_str(), &type, nullptr, nullptr, nullptr);
  if (topic < 0)
    ddsi_sertype_unref(type);
  return {topic, topic < 0 ? nullptr : type};
}

dds_return_t write_raw(dds_entity_t writer, const RawTopic& topic, recording::ByteView message) {
  RawData* data = new_data(topic.type, SDK_DATA, message.size());
  if (!data)
    return DDS_RETCODE_OUT_OF_RESOURCES;
  std::copy(message.begin(), message.end(), data->bytes());
  // NOLINTNEXTLINE(clang-analyzer-unix.Malloc): dds_writecdr takes the reference
  return dds_writecdr(writer, data);
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

} // namespace terrainseg::ros2
