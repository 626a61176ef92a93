// SPDX-License-Identifier: LGPL-2.1-or-later
// Records the messages of a stream: MCAP files (https://mcap.dev/spec) with ROS 2 topics. Time-stamped
// messages are in indexed chunks with zstd compression; chunks, data and summary have checksums.
#pragma once

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

/// After the sink has thrown, the recording must not be used. The file is then incomplete; its finished
/// chunks can be read.
class TerrainRecording : public MessageOutlet {
 public:
  /// A chunk ends with the message that exceeds this size or duration.
  static constexpr std::size_t chunk_bytes = 1 << 20;
  static constexpr std::uint64_t chunk_nanoseconds = 1'000'000'000;

  TerrainRecording(ByteSink sink, MessageOptions options);
  ~TerrainRecording() override;

  void add(const MessageFrame& frame) { messages_.add(frame, *this); }
  bool wants(Topic) override { return true; }
  /// Adds a message. `time` is in nanoseconds; times may be in any order.
  void put(Topic topic, std::uint64_t time, ByteView message) override;
  /// Writes the summary and ends the file. No other call may follow.
  void finish();
  /// Returns the metadata.yaml of a rosbag2 folder with this recording as the file `name`.
  std::string bag_metadata(const std::string& name) const;

 private:
  struct Channel {
    std::string topic;
    std::string type;           ///< such as sensor_msgs/msg/LaserScan
    Bytes schema, channel;      ///< records, written before the first message and in the summary
    std::uint64_t messages = 0; ///< written so far
  };
  using Index = std::vector<std::pair<std::uint64_t, std::uint64_t>>; ///< time, offset in the chunk
  struct ChunkIndex {
    std::uint64_t start_time, end_time, position, length, index_length, compressed, uncompressed;
    std::map<std::uint16_t, std::uint64_t> index_positions;
  };
  void write(ByteView bytes);
  template <class... Fields> void write_record(std::uint8_t opcode, const Fields&... fields);
  void flush();

  TerrainMessages messages_;
  ByteSink sink_;
  std::unique_ptr<ZSTD_CCtx_s, std::size_t (*)(ZSTD_CCtx_s*)> compressor_;
  std::vector<Channel> channels_; ///< element 0 has number 1
  std::vector<ChunkIndex> chunk_indexes_;
  Bytes header_; ///< written with the first message
  Bytes chunk_, compressed_, record_;
  std::map<std::uint16_t, Index> indexes_; ///< of the current chunk, by channel
  std::uint64_t chunk_start_ = 0, chunk_end_ = 0;
  std::uint64_t position_ = 0; ///< bytes given to the sink
  std::uint64_t message_count_ = 0;
  std::uint64_t start_time_ = 0, end_time_ = 0; ///< of the earliest and the latest message
  std::uint32_t data_crc_ = 0;
};

} // namespace terrainseg::recording
