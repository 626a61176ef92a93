// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/terrain_recording.hpp"

#include <zstd.h>

#include <algorithm>
#include <new>
#include <stdexcept>
#include <string_view>
#include <type_traits>

namespace terrainseg::recording {
namespace {

constexpr std::uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};
constexpr int zstd_level =
    1; ///< Masks are runs: higher levels take three times as long and save a tenth of the bytes.

enum Opcode : std::uint8_t {
  op_header = 0x01,
  op_footer = 0x02,
  op_schema = 0x03,
  op_channel = 0x04,
  op_message = 0x05,
  op_chunk = 0x06,
  op_message_index = 0x07,
  op_chunk_index = 0x08,
  op_statistics = 0x0b,
  op_summary_offset = 0x0e,
  op_data_end = 0x0f,
};

/// Writes the number of bytes that follow a length of `size` bytes at `at`.
void set_length(Bytes& out, std::size_t at, std::size_t size) {
  std::uint64_t length = out.size() - at - size;
  for (std::size_t i = 0; i < size; ++i, length >>= 8)
    out[at + i] = static_cast<std::uint8_t>(length);
}

/// Appends an integer, a text after its length, bytes, or a list of pairs after its length in bytes.
template <class Field> void put_field(Bytes& out, const Field& field) {
  if constexpr (std::is_integral_v<Field>) {
    put_integer(out, field);
  } else if constexpr (std::is_convertible_v<const Field&, std::string_view>) {
    const std::string_view text = field;
    put_integer(out, static_cast<std::uint32_t>(text.size()));
    append(out, bytes_of(text));
  } else if constexpr (std::is_same_v<Field, ByteView>) {
    append(out, field);
  } else {
    const std::size_t at = out.size();
    put_integer(out, std::uint32_t{0});
    for (const auto& [key, value] : field) {
      put_field(out, key);
      put_field(out, value);
    }
    set_length(out, at, 4);
  }
}

/// Appends a record of these fields.
template <class... Fields> void put_record(Bytes& out, std::uint8_t opcode, const Fields&... fields) {
  out.push_back(opcode);
  const std::size_t at = out.size();
  put_integer(out, std::uint64_t{0});
  (put_field(out, fields), ...);
  set_length(out, at, 8);
}

/// The number of a topic's channel. Recordings have no /tf_static: /tf contains the transforms of the mount
/// with every frame too.
std::uint16_t number_of(Topic topic) {
  return static_cast<std::uint16_t>(static_cast<int>(topic) + (topic < Topic::tf_static));
}

/// A text in double quotes.
std::string quoted_yaml(const std::string& text) {
  constexpr const char* digits = "0123456789abcdef";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20)
      (quoted += "\\x") += {digits[byte >> 4], digits[byte & 15]};
    else if (c == '"' || c == '\\')
      (quoted += '\\') += c;
    else
      quoted += c;
  }
  return quoted += '"';
}

} // namespace

TerrainRecording::TerrainRecording(ByteSink sink, MessageOptions options)
    : messages_(std::move(options)), sink_(std::move(sink)), compressor_(ZSTD_createCCtx(), ZSTD_freeCCtx) {
  if (!compressor_)
    throw std::bad_alloc();
  append(header_, magic);
  put_record(header_, op_header, "ros2", "terrainseg"); // profile, library
  const std::map<std::string, std::string> metadata = {{"offered_qos_profiles", ""}};
  for (std::size_t i = 0; i < topic_count; ++i) {
    const auto topic = static_cast<Topic>(i);
    if (topic == Topic::tf_static)
      continue;
    const std::string name = topic_kinds[i].name;
    const MessageType type = type_of(topic);
    Channel& channel = channels_.emplace_back();
    channel.topic = name.starts_with('/') ? name : "/" + name;
    channel.type = type.name;
    // Each channel has its own schema with the same number.
    put_record(channel.schema, op_schema, number_of(topic), type.name, "ros2msg", type.text);
    put_record(channel.channel, op_channel, number_of(topic), number_of(topic), channel.topic, "cdr",
               metadata);
  }
}

TerrainRecording::~TerrainRecording() = default;

void TerrainRecording::write(ByteView bytes) {
  if (!header_.empty())
    write(std::exchange(header_, {}));
  data_crc_ = crc32(bytes, data_crc_);
  position_ += bytes.size();
  sink_(bytes);
}

template <class... Fields> void TerrainRecording::write_record(std::uint8_t opcode, const Fields&... fields) {
  record_.clear();
  put_record(record_, opcode, fields...);
  write(record_);
}

void TerrainRecording::put(Topic topic, std::uint64_t time, ByteView message) {
  const std::uint16_t number = number_of(topic);
  Channel& channel = channels_[number - 1U];
  if (channel.messages == 0) {
    append(chunk_, channel.schema);
    append(chunk_, channel.channel);
  }
  chunk_start_ = indexes_.empty() ? time : std::min(chunk_start_, time);
  chunk_end_ = indexes_.empty() ? time : std::max(chunk_end_, time);
  start_time_ = message_count_ == 0 ? time : std::min(start_time_, time);
  end_time_ = std::max(end_time_, time);
  indexes_[number].emplace_back(time, chunk_.size());
  // The times: when it was recorded, and when it was published.
  put_record(chunk_, op_message, number, static_cast<std::uint32_t>(channel.messages), time, time, message);
  ++channel.messages;
  ++message_count_;
  if (chunk_.size() >= chunk_bytes || chunk_end_ - chunk_start_ >= chunk_nanoseconds)
    flush();
}

/// Ends the chunk, so that all messages so far are in the file.
void TerrainRecording::flush() {
  write({}); // the header
  if (indexes_.empty())
    return;
  compressed_.resize(ZSTD_compressBound(chunk_.size()));
  const std::size_t size = ZSTD_compressCCtx(compressor_.get(), compressed_.data(), compressed_.size(),
                                             chunk_.data(), chunk_.size(), zstd_level);
  if (ZSTD_isError(size)) // out of memory; the output buffer has room for the worst case
    throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  const ByteView records = ByteView(compressed_).first(size);
  const std::uint64_t begin = position_;
  write_record(op_chunk, chunk_start_, chunk_end_, std::uint64_t{chunk_.size()}, crc32(chunk_), "zstd",
               std::uint64_t{records.size()}, records);
  const std::uint64_t end = position_;
  ChunkIndex chunk{chunk_start_, chunk_end_, begin, end - begin, 0, records.size(), chunk_.size(), {}};
  for (auto& [number, index] : indexes_) {
    std::ranges::stable_sort(index, {}, &Index::value_type::first);
    chunk.index_positions[number] = position_;
    write_record(op_message_index, number, index);
  }
  chunk.index_length = position_ - end;
  chunk_indexes_.push_back(std::move(chunk));
  chunk_.clear();
  indexes_.clear();
}

void TerrainRecording::finish() {
  flush();
  write_record(op_data_end, data_crc_);

  Bytes schemas, channels, statistics, chunk_indexes;
  std::map<std::uint16_t, std::uint64_t> messages; // by channel
  for (std::uint16_t number = 1; const Channel& channel : channels_) {
    if (channel.messages > 0) {
      append(schemas, channel.schema);
      append(channels, channel.channel);
      messages[number] = channel.messages;
    }
    ++number;
  }
  const auto used = static_cast<std::uint32_t>(messages.size());
  constexpr std::uint32_t attachments = 0, metadata_records = 0;
  put_record(statistics, op_statistics, message_count_, static_cast<std::uint16_t>(used), used, attachments,
             metadata_records, static_cast<std::uint32_t>(chunk_indexes_.size()), start_time_, end_time_,
             messages);
  for (const ChunkIndex& chunk : chunk_indexes_)
    put_record(chunk_indexes, op_chunk_index, chunk.start_time, chunk.end_time, chunk.position, chunk.length,
               chunk.index_positions, chunk.index_length, "zstd", chunk.compressed, chunk.uncompressed);

  const std::uint64_t begin = position_;
  Bytes summary, offsets;
  const auto add_group = [&](std::uint8_t opcode, const Bytes& records) {
    if (records.empty())
      return;
    put_record(offsets, op_summary_offset, opcode, begin + summary.size(), std::uint64_t{records.size()});
    append(summary, records);
  };
  add_group(op_schema, schemas);
  add_group(op_channel, channels);
  add_group(op_statistics, statistics);
  add_group(op_chunk_index, chunk_indexes);
  const std::uint64_t offsets_begin = begin + summary.size();
  append(summary, offsets);
  // The checksum is the last field of the footer and covers everything before it, including the record's
  // length.
  put_record(summary, op_footer, begin, offsets_begin, std::uint32_t{0});
  constexpr std::size_t crc_size = 4;
  const std::uint32_t crc = crc32(ByteView(summary).first(summary.size() - crc_size));
  summary.resize(summary.size() - crc_size);
  put_integer(summary, crc);
  append(summary, magic);
  write(summary);
}

std::string TerrainRecording::bag_metadata(const std::string& name) const {
  const std::string start = std::to_string(start_time_);
  const std::string duration = std::to_string(end_time_ - start_time_);
  const std::string messages = std::to_string(message_count_);
  std::string text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n"
                     "    nanoseconds: " +
                     duration + "\n  starting_time:\n    nanoseconds_since_epoch: " + start +
                     "\n  message_count: " + messages + "\n  topics_with_message_count:\n";
  for (const Channel& channel : channels_)
    if (channel.messages > 0)
      text +=
          "    - topic_metadata:\n        name: " + channel.topic + "\n        type: " + channel.type +
          "\n        serialization_format: cdr\n        offered_qos_profiles: \"\"\n      message_count: " +
          std::to_string(channel.messages) + "\n";
  const std::string quoted = quoted_yaml(name);
  text += "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " + quoted +
          "\n  files:\n    - path: " + quoted +
          "\n      starting_time:\n        nanoseconds_since_epoch: " + start +
          "\n      duration:\n        nanoseconds: " + duration + "\n      message_count: " + messages + "\n";
  return text;
}

} // namespace terrainseg::recording
