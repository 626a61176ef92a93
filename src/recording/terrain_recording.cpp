// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/terrain_recording.hpp"

#include <zstd.h>

#include <algorithm>
#include <new>
#include <stdexcept>
#include <utility>

#include "exchange/bytes.hpp"

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

/// A record in `out`; the destructor fills in its length.
class Record {
 public:
  Record(Bytes& out, Opcode opcode) : out_(out) {
    out_.push_back(opcode);
    at_ = out_.size();
    put_integer(out_, std::uint64_t{0});
  }
  ~Record() { set_length(at_, 8); }
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;

  template <class Integer> void integer(Integer value) { put_integer(out_, value); }
  void string(std::string_view text) {
    integer(static_cast<std::uint32_t>(text.size()));
    append(out_, bytes_of(text));
  }
  void bytes(ByteView data) { append(out_, data); }
  /// A list of the elements that `items` appends, after its length in bytes.
  template <class Items> void list(Items items) {
    const std::size_t at = out_.size();
    integer(std::uint32_t{0});
    items();
    set_length(at, 4);
  }

 private:
  void set_length(std::size_t at, std::size_t size) {
    std::uint64_t length = out_.size() - at - size;
    for (std::size_t i = 0; i < size; ++i, length >>= 8)
      out_[at + i] = static_cast<std::uint8_t>(length);
  }
  Bytes& out_;
  std::size_t at_;
};

/// Recordings have no /tf_static: /tf contains the transforms of the mount with every frame too.
struct Channel {
  Topic topic;
  const char* name;
};
constexpr Channel recorded[] = {{Topic::scan, "/terrain/scan"},
                                {Topic::points, "/terrain/points"},
                                {Topic::grid, "/terrain/grid"},
                                {Topic::mask, "/terrain/mask"},
                                {Topic::camera_info, "/camera/camera_info"},
                                {Topic::video, "/camera/video"},
                                {Topic::picture, "/camera/image/compressed"},
                                {Topic::tf, "/tf"},
                                {Topic::diagnostics, "/diagnostics"}};

McapWriter::Channel channel_of(const char* topic, MessageType type) {
  return {topic, "cdr", type.name, "ros2msg", std::move(type.text), {{"offered_qos_profiles", ""}}, 0};
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

McapWriter::McapWriter(ByteSink sink, const std::string& profile, const std::string& library)
    : sink_(std::move(sink)), compressor_(ZSTD_createCCtx(), ZSTD_freeCCtx) {
  if (!compressor_)
    throw std::bad_alloc();
  append(header_, magic);
  Record record(header_, op_header);
  record.string(profile);
  record.string(library);
}

McapWriter::~McapWriter() = default;

bool McapWriter::put(ByteView bytes) {
  if (!header_.empty()) {
    const Bytes header = std::exchange(header_, {});
    if (!put(header))
      return false;
  }
  data_crc_ = crc32(bytes, data_crc_);
  position_ += bytes.size();
  return sink_(bytes);
}

std::uint16_t McapWriter::add_channel(Channel channel) {
  channels_.push_back(std::move(channel));
  return static_cast<std::uint16_t>(channels_.size());
}

/// Writes schema and channel. Each channel has its own schema with the same number.
void McapWriter::append_schema(Bytes& out, std::uint16_t number) const {
  const Channel& channel = channels_[number - 1U];
  Record record(out, op_schema);
  record.integer(number);
  record.string(channel.schema);
  record.string(channel.schema_encoding);
  record.string(channel.schema_text);
}

void McapWriter::append_channel(Bytes& out, std::uint16_t number) const {
  const Channel& channel = channels_[number - 1U];
  Record record(out, op_channel);
  record.integer(number);
  record.integer(number);
  record.string(channel.topic);
  record.string(channel.encoding);
  record.list([&] {
    for (const auto& [key, value] : channel.metadata) {
      record.string(key);
      record.string(value);
    }
  });
}

bool McapWriter::write(std::uint16_t number, std::uint64_t time, ByteView data) {
  Channel& channel = channels_.at(number - 1U);
  if (channel.messages == 0) {
    append_schema(chunk_, number);
    append_channel(chunk_, number);
  }
  chunk_start_ = indexes_.empty() ? time : std::min(chunk_start_, time);
  chunk_end_ = indexes_.empty() ? time : std::max(chunk_end_, time);
  start_time_ = messages_ == 0 ? time : std::min(start_time_, time);
  end_time_ = messages_ == 0 ? time : std::max(end_time_, time);
  indexes_[number].emplace_back(time, chunk_.size());
  {
    Record record(chunk_, op_message);
    record.integer(number);
    record.integer(static_cast<std::uint32_t>(channel.messages));
    record.integer(time); // when it was recorded
    record.integer(time); // when it was published
    record.bytes(data);
  }
  ++channel.messages;
  ++messages_;
  if (chunk_.size() >= chunk_bytes || chunk_end_ - chunk_start_ >= chunk_nanoseconds)
    return flush();
  return true;
}

ByteView McapWriter::compress() {
  compressed_.resize(ZSTD_compressBound(chunk_.size()));
  const std::size_t size = ZSTD_compressCCtx(compressor_.get(), compressed_.data(), compressed_.size(),
                                             chunk_.data(), chunk_.size(), zstd_level);
  if (ZSTD_isError(size)) // out of memory; the output buffer has room for the worst case
    throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  return {compressed_.data(), size};
}

bool McapWriter::write_indexes(ChunkIndex& chunk) {
  const std::uint64_t begin = position_;
  for (auto& [number, index] : indexes_) {
    std::stable_sort(index.begin(), index.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    chunk.index_positions[number] = position_;
    record_.clear();
    {
      Record record(record_, op_message_index);
      record.integer(number);
      record.list([&, &entries = index] {
        for (const auto& [time, offset] : entries) {
          record.integer(time);
          record.integer(offset);
        }
      });
    }
    if (!put(record_))
      return false;
  }
  chunk.index_length = position_ - begin;
  return true;
}

bool McapWriter::flush() {
  if (indexes_.empty())
    return header_.empty() || put({});
  const ByteView records = compress();
  record_.clear();
  {
    Record record(record_, op_chunk);
    record.integer(chunk_start_);
    record.integer(chunk_end_);
    record.integer(std::uint64_t{chunk_.size()});
    record.integer(crc32(chunk_));
    record.string("zstd");
    record.integer(std::uint64_t{records.size()});
    record.bytes(records);
  }
  if (!header_.empty() && !put({}))
    return false;
  ChunkIndex chunk{chunk_start_, chunk_end_, position_, record_.size(), 0, records.size(), chunk_.size(), {}};
  if (!put(record_) || !write_indexes(chunk))
    return false;
  chunk_indexes_.push_back(std::move(chunk));
  chunk_.clear();
  indexes_.clear();
  return true;
}

void McapWriter::append_statistics(Bytes& out) const {
  const auto used = static_cast<std::uint32_t>(
      std::count_if(channels_.begin(), channels_.end(), [](const Channel& c) { return c.messages > 0; }));
  Record record(out, op_statistics);
  record.integer(messages_);
  record.integer(static_cast<std::uint16_t>(used)); // schemas
  record.integer(used);                             // channels
  record.integer(std::uint32_t{0});                 // attachments
  record.integer(std::uint32_t{0});                 // metadata records
  record.integer(static_cast<std::uint32_t>(chunk_indexes_.size()));
  record.integer(start_time_);
  record.integer(end_time_);
  record.list([&] {
    for (std::size_t i = 0; i < channels_.size(); ++i)
      if (channels_[i].messages > 0) {
        record.integer(static_cast<std::uint16_t>(i + 1));
        record.integer(channels_[i].messages);
      }
  });
}

void McapWriter::append_chunk_indexes(Bytes& out) const {
  for (const ChunkIndex& chunk : chunk_indexes_) {
    Record record(out, op_chunk_index);
    record.integer(chunk.start_time);
    record.integer(chunk.end_time);
    record.integer(chunk.position);
    record.integer(chunk.length);
    record.list([&] {
      for (const auto& [number, position] : chunk.index_positions) {
        record.integer(number);
        record.integer(position);
      }
    });
    record.integer(chunk.index_length);
    record.string("zstd");
    record.integer(chunk.compressed);
    record.integer(chunk.uncompressed);
  }
}

bool McapWriter::finish() {
  if (!flush())
    return false;
  record_.clear();
  {
    Record end(record_, op_data_end);
    end.integer(data_crc_);
  }
  if (!put(record_))
    return false;

  const std::uint64_t begin = position_;
  Bytes summary;
  struct Group {
    Opcode opcode;
    std::uint64_t begin, end;
  };
  std::vector<Group> groups;
  const auto group = [&](Opcode opcode, auto fill) {
    const std::uint64_t from = begin + summary.size();
    fill();
    if (const std::uint64_t to = begin + summary.size(); to > from)
      groups.push_back({opcode, from, to});
  };
  const auto each_used_channel = [&](void (McapWriter::*append_it)(Bytes&, std::uint16_t) const) {
    for (std::size_t i = 0; i < channels_.size(); ++i)
      if (channels_[i].messages > 0)
        (this->*append_it)(summary, static_cast<std::uint16_t>(i + 1));
  };
  group(op_schema, [&] { each_used_channel(&McapWriter::append_schema); });
  group(op_channel, [&] { each_used_channel(&McapWriter::append_channel); });
  group(op_statistics, [&] { append_statistics(summary); });
  group(op_chunk_index, [&] { append_chunk_indexes(summary); });
  const std::uint64_t offsets = begin + summary.size();
  for (const Group& each : groups) {
    Record record(summary, op_summary_offset);
    record.integer(static_cast<std::uint8_t>(each.opcode));
    record.integer(each.begin);
    record.integer(each.end - each.begin);
  }
  {
    Record footer(summary, op_footer);
    footer.integer(begin);
    footer.integer(offsets);
    footer.integer(std::uint32_t{0});
  }
  // The checksum is the last field of the footer and covers everything before it, including the record's
  // length.
  constexpr std::size_t crc_size = 4;
  const std::uint32_t crc = crc32(ByteView(summary).first(summary.size() - crc_size));
  summary.resize(summary.size() - crc_size);
  put_integer(summary, crc);
  append(summary, magic);
  return put(summary);
}

TerrainRecording::TerrainRecording(ByteSink sink, MessageOptions options)
    : messages_(std::move(options)), writer_(std::move(sink), "ros2", "terrainseg") {
  const auto channel = [&](Topic topic) -> std::uint16_t& {
    return channels_[static_cast<std::size_t>(topic)];
  };
  for (const auto& [topic, name] : recorded)
    channel(topic) = writer_.add_channel(channel_of(name, type_of(topic)));
  channel(Topic::tf_static) = channel(Topic::tf);
}

std::string TerrainRecording::bag_metadata(const std::string& name) const {
  const std::string start = std::to_string(writer_.start_time());
  const std::string duration = std::to_string(writer_.end_time() - writer_.start_time());
  const std::string messages = std::to_string(writer_.messages());
  std::string text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n"
                     "    nanoseconds: " +
                     duration + "\n  starting_time:\n    nanoseconds_since_epoch: " + start +
                     "\n  message_count: " + messages + "\n  topics_with_message_count:\n";
  for (const McapWriter::Channel& channel : writer_.channels())
    if (channel.messages > 0)
      text +=
          "    - topic_metadata:\n        name: " + channel.topic + "\n        type: " + channel.schema +
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
