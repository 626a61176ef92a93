// SPDX-License-Identifier: LGPL-2.1-or-later
// Records the messages of a stream: MCAP files (https://mcap.dev/spec) with ROS 2 topics. Time-stamped
// messages are in indexed chunks with zstd compression; chunks, data and summary have checksums.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "recording/terrain_messages.hpp"

struct ZSTD_CCtx_s;

namespace terrainseg::recording {

/// Writes the next bytes of the file; throws on an error.
using ByteSink = std::function<void(ByteView)>;

/// After the sink has thrown, the writer must not be used. The file is then incomplete; its finished chunks
/// can be read.
class McapWriter {
 public:
  struct Channel {
    std::string topic;
    MessageType type;
    std::uint64_t messages = 0; ///< written so far
  };
  /// A chunk ends with the message that exceeds this size or duration.
  static constexpr std::size_t chunk_bytes = 1 << 20;
  static constexpr std::uint64_t chunk_nanoseconds = 1'000'000'000;

  explicit McapWriter(ByteSink sink);
  ~McapWriter();

  /// Adds a channel and returns its number for write(). It is written to the file, with its schema, with its
  /// first message.
  std::uint16_t add_channel(std::string topic, MessageType type);
  /// Adds a message. `time` is in nanoseconds; times may be in any order.
  void write(std::uint16_t channel, std::uint64_t time, ByteView data);
  /// Writes the summary and ends the file. No other call may follow.
  void finish();

  const std::vector<Channel>& channels() const { return channels_; }
  std::uint64_t messages() const { return messages_; }
  std::uint64_t start_time() const { return start_time_; } ///< of the earliest message, 0 = no message
  std::uint64_t end_time() const { return end_time_; }     ///< of the latest
  std::uint64_t size() const { return position_; }         ///< bytes given to the sink

 private:
  using Index = std::vector<std::pair<std::uint64_t, std::uint64_t>>; ///< time, offset in the chunk
  struct ChunkIndex {
    std::uint64_t start_time, end_time, position, length, index_length, compressed, uncompressed;
    std::map<std::uint16_t, std::uint64_t> index_positions;
  };
  void put(ByteView bytes);
  ByteView compress();
  void flush();

  ByteSink sink_;
  std::unique_ptr<ZSTD_CCtx_s, std::size_t (*)(ZSTD_CCtx_s*)> compressor_;
  std::vector<Channel> channels_; ///< element 0 has number 1
  std::vector<ChunkIndex> chunk_indexes_;
  Bytes header_; ///< written with the first message
  Bytes chunk_, compressed_, record_;
  std::map<std::uint16_t, Index> indexes_; ///< of the current chunk, by channel
  std::uint64_t chunk_start_ = 0, chunk_end_ = 0;
  std::uint64_t position_ = 0, messages_ = 0, start_time_ = 0, end_time_ = 0;
  std::uint32_t data_crc_ = 0;
};

class TerrainRecording : private MessageOutlet {
 public:
  TerrainRecording(ByteSink sink, MessageOptions options);

  void add(const MessageFrame& frame) { messages_.add(frame, *this); }
  void finish() { writer_.finish(); }

  /// Returns the metadata.yaml of a rosbag2 folder with this recording as the file `name`.
  std::string bag_metadata(const std::string& name) const;
  const McapWriter& writer() const { return writer_; }

 private:
  bool wants(Topic) override { return true; }
  void put(Topic topic, std::uint64_t time, ByteView message) override {
    writer_.write(channels_[static_cast<std::size_t>(topic)], time, message);
  }

  TerrainMessages messages_;
  McapWriter writer_;
  std::array<std::uint16_t, topic_count> channels_{};
};

} // namespace terrainseg::recording
