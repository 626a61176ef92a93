// SPDX-License-Identifier: LGPL-2.1-or-later
// A container of time-stamped messages: MCAP (https://mcap.dev/spec), in chunks that are compressed with zstd
// and indexed, with checksums over chunks, data and summary.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "recording/little_endian.hpp"

struct ZSTD_CCtx_s;

namespace terrainseg::recording {

/// Takes the file's next bytes; false when they could not be written.
using ByteSink = std::function<bool(ByteView)>;

/// Not to be used any more after a function has returned false: the file then ends wherever it ends, and what
/// was written before can be read.
class McapWriter {
 public:
  struct Channel {
    std::string topic;
    std::string encoding;        ///< of the messages: cdr
    std::string schema;          ///< name of their type: sensor_msgs/msg/LaserScan
    std::string schema_encoding; ///< ros2msg
    std::string schema_text;
    std::map<std::string, std::string> metadata;
    std::uint64_t messages = 0; ///< written so far
  };
  /// A chunk ends with the message that makes it this large, or this long.
  static constexpr std::size_t chunk_bytes = 1 << 20;
  static constexpr std::uint64_t chunk_nanoseconds = 1'000'000'000;

  McapWriter(ByteSink sink, const std::string& profile, const std::string& library);
  ~McapWriter();

  /// Announces a channel; it and its schema appear in the file with the first message. The number for
  /// write().
  std::uint16_t add_channel(Channel channel);
  /// Adds a message; `time` in nanoseconds, in any order.
  [[nodiscard]] bool write(std::uint16_t channel, std::uint64_t time, ByteView data);
  /// Ends the chunk: what was written until here is in the file.
  [[nodiscard]] bool flush();
  /// Ends the file with its summary. Nothing may follow.
  [[nodiscard]] bool finish();

  const std::vector<Channel>& channels() const { return channels_; }
  std::uint64_t messages() const { return messages_; }
  std::uint64_t start_time() const { return start_time_; } ///< of the earliest message, 0 = none
  std::uint64_t end_time() const { return end_time_; }     ///< of the latest
  std::uint64_t size() const { return position_; }         ///< bytes handed to the sink

 private:
  using Index = std::vector<std::pair<std::uint64_t, std::uint64_t>>; ///< time, offset in the chunk
  struct ChunkIndex {
    std::uint64_t start_time, end_time, position, length, index_length, compressed, uncompressed;
    std::map<std::uint16_t, std::uint64_t> index_positions;
  };
  bool put(ByteView bytes);
  void append_announcement(Bytes& out, std::uint16_t channel) const;
  void append_statistics(Bytes& out) const;
  ByteView compress();
  bool write_indexes(ChunkIndex& chunk);

  ByteSink sink_;
  std::unique_ptr<ZSTD_CCtx_s, std::size_t (*)(ZSTD_CCtx_s*)> compressor_;
  std::vector<Channel> channels_; ///< number 1 is the first
  std::vector<ChunkIndex> chunk_indexes_;
  Bytes header_; ///< waits for the first write
  Bytes chunk_, compressed_, record_;
  std::map<std::uint16_t, Index> indexes_; ///< of the chunk
  std::uint64_t chunk_start_ = 0, chunk_end_ = 0;
  std::uint64_t position_ = 0, messages_ = 0, start_time_ = 0, end_time_ = 0;
  std::uint32_t data_crc_ = 0;
};

} // namespace terrainseg::recording
