// SPDX-License-Identifier: LGPL-2.1-or-later
// Recordings, read back by a reader of MCAP and CDR that stands here and knows nothing of the writer.
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>
#include <zstd.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "recording/free_space_shapes.hpp"
#include "recording/h264_unit.hpp"
#include "recording/ros_messages.hpp"
#include "recording/terrain_recording.hpp"

namespace terrainseg::recording {
namespace {

using namespace std::string_literals;

constexpr float nan_value = std::numeric_limits<float>::quiet_NaN();
constexpr float inf_value = std::numeric_limits<float>::infinity();

std::string hex(const Bytes& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    char two[3];
    std::snprintf(two, sizeof two, "%02x", byte);
    text += two;
  }
  return text;
}

/// Bit by bit, from the polynomial.
std::uint32_t slow_crc(ByteView bytes) {
  std::uint32_t c = 0xffffffff;
  for (const std::uint8_t byte : bytes) {
    c ^= byte;
    for (int i = 0; i < 8; ++i)
      c = (c >> 1) ^ (0xedb88320 & (0 - (c & 1)));
  }
  return ~c;
}

/// Takes numbers and texts off the front of bytes; a test fails where they end too soon.
class Reader {
 public:
  explicit Reader(ByteView bytes) : bytes_(bytes) {}
  template <class T> T take() {
    T value{};
    if (at_ + sizeof value > bytes_.size()) {
      ADD_FAILURE() << "ends at " << bytes_.size();
      at_ = bytes_.size();
      return value;
    }
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  ByteView view(std::size_t size) {
    if (at_ + size > bytes_.size()) {
      ADD_FAILURE() << "ends at " << bytes_.size();
      size = bytes_.size() - at_;
    }
    at_ += size;
    return bytes_.subspan(at_ - size, size);
  }
  std::string string() {
    const ByteView text = view(take<std::uint32_t>());
    return {text.begin(), text.end()};
  }
  std::size_t at() const { return at_; }
  bool over() const { return at_ == bytes_.size(); }
  /// Of CDR: to a multiple of `size`, counted from behind the encapsulation.
  void align(std::size_t size) {
    while ((at_ - 4) % size)
      ++at_;
  }

 private:
  ByteView bytes_;
  std::size_t at_ = 0;
};

struct ReadMessage {
  std::uint16_t channel;
  std::uint32_t sequence;
  std::uint64_t time;
  Bytes data;
  bool operator==(const ReadMessage&) const = default;
};

struct ReadFile {
  std::string profile;
  std::map<std::uint16_t, std::string> topics, schemas;
  std::vector<ReadMessage> messages;
  std::size_t chunks = 0, indexed = 0;
  bool whole = false; ///< the footer came
  std::uint64_t counted = 0;
};

constexpr std::uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

void read_records(ByteView bytes, ReadFile& file, std::map<std::uint64_t, ReadMessage>* by_offset);

ReadMessage read_message(ByteView content) {
  Reader r(content);
  ReadMessage m{r.take<std::uint16_t>(), r.take<std::uint32_t>(), r.take<std::uint64_t>(), {}};
  EXPECT_EQ(r.take<std::uint64_t>(), m.time) << "publish time";
  const ByteView data = r.view(content.size() - r.at());
  m.data.assign(data.begin(), data.end());
  return m;
}

/// The chunk's messages by their place in it, for the indexes behind it.
std::map<std::uint64_t, ReadMessage> read_chunk(ByteView content, ReadFile& file) {
  Reader r(content);
  const auto start = r.take<std::uint64_t>(), end = r.take<std::uint64_t>(), size = r.take<std::uint64_t>();
  const auto crc = r.take<std::uint32_t>();
  EXPECT_EQ(r.string(), "zstd");
  const ByteView packed = r.view(r.take<std::uint64_t>());
  EXPECT_TRUE(r.over());
  Bytes records(size);
  EXPECT_EQ(ZSTD_decompress(records.data(), size, packed.data(), packed.size()), size);
  EXPECT_EQ(slow_crc(records), crc);
  std::map<std::uint64_t, ReadMessage> by_offset;
  const std::size_t before = file.messages.size();
  read_records(records, file, &by_offset);
  std::uint64_t least = ~0ull, most = 0;
  for (std::size_t i = before; i < file.messages.size(); ++i) {
    least = std::min(least, file.messages[i].time);
    most = std::max(most, file.messages[i].time);
  }
  EXPECT_EQ(start, least);
  EXPECT_EQ(end, most);
  ++file.chunks;
  return by_offset;
}

void read_index(ByteView content, ReadFile& file, const std::map<std::uint64_t, ReadMessage>& by_offset) {
  Reader r(content);
  const auto channel = r.take<std::uint16_t>();
  const auto size = r.take<std::uint32_t>();
  std::uint64_t last = 0;
  for (std::uint32_t i = 0; i < size; i += 16, ++file.indexed) {
    const auto time = r.take<std::uint64_t>(), offset = r.take<std::uint64_t>();
    EXPECT_GE(time, last) << "an index is in the order of time";
    last = time;
    const auto found = by_offset.find(offset);
    ASSERT_NE(found, by_offset.end()) << "no message at " << offset;
    EXPECT_EQ(found->second.time, time);
    EXPECT_EQ(found->second.channel, channel);
  }
  EXPECT_TRUE(r.over());
}

/// What is whole of `bytes`, which begin behind the magic; ends quietly where a record is cut.
void read_records(ByteView bytes, ReadFile& file, std::map<std::uint64_t, ReadMessage>* by_offset) {
  std::map<std::uint64_t, ReadMessage> chunk;
  std::size_t at = 0;
  while (at + 9 <= bytes.size() && !file.whole) {
    std::uint64_t length;
    std::memcpy(&length, &bytes[at + 1], 8);
    if (length > bytes.size() - at - 9)
      return;
    const ByteView content = bytes.subspan(at + 9, length);
    Reader r(content);
    switch (bytes[at]) {
    case 1:
      file.profile = r.string();
      break;
    case 3: {
      const auto number = r.take<std::uint16_t>();
      file.schemas[number] = r.string();
      EXPECT_EQ(r.string(), "ros2msg");
      break;
    }
    case 4: {
      const auto number = r.take<std::uint16_t>();
      EXPECT_TRUE(file.schemas.count(r.take<std::uint16_t>())) << "the schema comes first";
      file.topics[number] = r.string();
      EXPECT_EQ(r.string(), "cdr");
      break;
    }
    case 5:
      file.messages.push_back(read_message(content));
      EXPECT_TRUE(file.topics.count(file.messages.back().channel)) << "the channel comes first";
      by_offset->emplace(at, file.messages.back());
      break;
    case 6:
      chunk = read_chunk(content, file);
      break;
    case 7:
      read_index(content, file, chunk);
      break;
    case 11:
      file.counted = r.take<std::uint64_t>();
      break;
    case 2:
      file.whole = true;
      break;
    default:
      break;
    }
    at += 9 + length;
  }
}

ReadFile read_file(const Bytes& bytes) {
  ReadFile file;
  EXPECT_GE(bytes.size(), sizeof magic);
  if (bytes.size() < sizeof magic)
    return file;
  EXPECT_EQ(std::memcmp(bytes.data(), magic, sizeof magic), 0);
  read_records(ByteView(bytes).subspan(sizeof magic), file, nullptr);
  file.whole =
      file.whole && std::memcmp(bytes.data() + bytes.size() - sizeof magic, magic, sizeof magic) == 0;
  if (!file.whole)
    return file;
  // From the end: footer, summary, end of the data.
  constexpr std::size_t footer_size = 9 + 20;
  const std::size_t footer = bytes.size() - sizeof magic - footer_size;
  Reader r(ByteView(bytes).subspan(footer));
  EXPECT_EQ(r.take<std::uint8_t>(), 2);
  EXPECT_EQ(r.take<std::uint64_t>(), 20u);
  const auto summary = r.take<std::uint64_t>(), offsets = r.take<std::uint64_t>();
  EXPECT_LE(summary, offsets);
  EXPECT_EQ(slow_crc(ByteView(bytes).subspan(summary, footer + footer_size - 4 - summary)),
            r.take<std::uint32_t>());
  Reader end(ByteView(bytes).subspan(summary - 13));
  EXPECT_EQ(end.take<std::uint8_t>(), 15);
  end.take<std::uint64_t>();
  EXPECT_EQ(slow_crc(ByteView(bytes).first(summary - 13)), end.take<std::uint32_t>());
  // Chunk indexes point at chunks, groups at records of their kind.
  for (std::size_t at = summary; at < footer;) {
    Reader record(ByteView(bytes).subspan(at));
    const auto opcode = record.take<std::uint8_t>();
    const auto length = record.take<std::uint64_t>();
    if (opcode == 8) {
      record.take<std::uint64_t>();
      record.take<std::uint64_t>();
      const auto position = record.take<std::uint64_t>();
      const auto size = record.take<std::uint64_t>();
      std::uint64_t stored;
      std::memcpy(&stored, &bytes[position + 1], 8);
      EXPECT_EQ(bytes[position], 6);
      EXPECT_EQ(stored + 9, size);
      for (std::uint32_t left = record.take<std::uint32_t>(); left > 0; left -= 10) {
        const auto channel = record.take<std::uint16_t>();
        const auto index = record.take<std::uint64_t>();
        EXPECT_EQ(bytes[index], 7);
        EXPECT_EQ(bytes[index + 9], channel);
      }
    }
    if (opcode == 14) {
      const auto kind = record.take<std::uint8_t>();
      EXPECT_EQ(bytes[record.take<std::uint64_t>()], kind);
    }
    at += 9 + length;
  }
  return file;
}

struct DiskFull {};

/// A writer into memory that is full at `room` bytes.
struct Disk {
  Bytes bytes;
  std::size_t room = ~std::size_t{0};
  ByteSink sink() {
    return [this](ByteView more) {
      const std::size_t taken = std::min(more.size(), room - bytes.size());
      append(bytes, more.first(taken));
      if (taken < more.size())
        throw DiskFull();
    };
  }
};

TEST(Cdr, LaserScanHasTheGoldenBytes) {
  const std::array<float, 5> ranges = {1.5f, 2, inf_value, nan_value, 3.25f};
  Bytes bytes;
  encode(bytes, {1700000000000000000, "base_link"}, LaserScan{{-0.5, 0.25, 5, 0.3}, 1.0 / 30, 8, ranges});
  EXPECT_EQ(
      hex(bytes),
      "0001000000f15365000000000a000000626173655f6c696e6b000000000000bf0000003f0000803e000000008988083d9a99"
      "993e00000041050000000000c03f000000400000807f0000c07f0000504000000000");
}

TEST(Cdr, OccupancyGridHasTheGoldenBytes) {
  const std::array<std::int8_t, 8> cells = {0, 0, 100, -1, 0, 100, -1, -1};
  Bytes bytes;
  encode(bytes, {1700000000000000000, "base_link"}, OccupancyGrid{{0.1, 4, 2, 0, -0.1}, cells});
  EXPECT_EQ(
      hex(bytes),
      "0001000000f15365000000000a000000626173655f6c696e6b00000000f1536500000000cdcccc3d04000000020000000000"
      "000000000000000000009a9999999999b9bf0000000000000000000000000000000000000000000000000000000000000000"
      "000000000000f03f08000000000064ff0064ffff");
}

TEST(TerrainRecording, GivesBackWhatWasWritten) {
  Disk disk;
  TerrainRecording recording(disk.sink(), {});
  std::mt19937 random(7);
  std::vector<ReadMessage> expected;
  std::map<std::uint16_t, std::uint32_t> sequence;
  for (int i = 0; i < 400; ++i) {
    Bytes data(random() % 5000);
    for (std::uint8_t& byte : data)
      byte = static_cast<std::uint8_t>(random() % 9);
    const bool diagnostics = random() % 3 == 0;
    const std::uint16_t channel = diagnostics ? 9 : 1;
    // Out of order by up to half a second.
    const std::uint64_t time = 1'000'000'000ull * 1'700'000'000 + 33'000'000ull * i + random() % 500'000'000;
    expected.push_back({channel, sequence[channel]++, time, data});
    recording.put(diagnostics ? Topic::diagnostics : Topic::scan, time, data);
  }
  recording.finish();
  const ReadFile file = read_file(disk.bytes);
  EXPECT_TRUE(file.whole);
  EXPECT_EQ(file.profile, "ros2");
  EXPECT_EQ(file.messages, expected);
  EXPECT_EQ(file.indexed, expected.size()) << "every message stands in an index";
  EXPECT_EQ(file.counted, expected.size());
  EXPECT_GE(file.chunks, 13u) << "a chunk holds at most a second";
  EXPECT_EQ(file.topics, (std::map<std::uint16_t, std::string>{{1, "/terrain/scan"}, {9, "/diagnostics"}}));
}

TEST(TerrainRecording, AnEmptyRecordingIsAFile) {
  Disk disk;
  TerrainRecording recording(disk.sink(), {});
  recording.finish();
  const ReadFile file = read_file(disk.bytes);
  EXPECT_TRUE(file.whole);
  EXPECT_EQ(file.messages.size(), 0u);
  EXPECT_EQ(file.counted, 0u);
}

TEST(TerrainRecording, AFullDiskLeavesAReadablePrefix) {
  const Bytes data(1000, 5);
  const auto fill = [&](Disk& disk) {
    TerrainRecording recording(disk.sink(), {});
    for (std::uint64_t i = 0; i < 100; ++i)
      recording.put(Topic::scan, i * 100'000'000, data);
    recording.finish();
  };
  Disk whole;
  fill(whole);
  std::size_t most = 0;
  for (std::size_t room = sizeof magic; room < whole.bytes.size(); room += 7) {
    Disk disk{{}, room};
    EXPECT_THROW(fill(disk), DiskFull) << room;
    const ReadFile file = read_file(disk.bytes);
    EXPECT_FALSE(file.whole);
    for (std::size_t i = 0; i < file.messages.size(); ++i)
      EXPECT_EQ(file.messages[i].sequence, i);
    most = std::max(most, file.messages.size());
  }
  EXPECT_EQ(most, 100u);
}

/// NAL units with start codes of four bytes; a slice's header says 0 for its first macroblock, then its type.
Bytes unit_of(std::initializer_list<Bytes> nals) {
  Bytes unit;
  for (const Bytes& nal : nals) {
    append(unit, Bytes{0, 0, 0, 1});
    append(unit, nal);
  }
  return unit;
}
const Bytes delimiter_nal = {0x09, 0xf0}, sequence_nal = {0x67, 1, 2, 3}, picture_nal = {0x68, 4},
            idr_nal = {0x65, 0x88, 0x80}; // ue(0) ue(7): 1 0001000
// ue(0) ue(5): 1 00110 -> 10011000; ue(0) ue(1): 1 010 -> 10100000; ue(0) ue(6): 1 00111 -> 10011100
const Bytes p_nal = {0x41, 0x98}, b_nal = {0x01, 0xa0}, b_only_nal = {0x01, 0x9c};

TEST(H264Unit, TellsWhatIsInIt) {
  const auto told = [](const Bytes& unit) {
    const H264Unit kind = inspect_h264(unit);
    return std::array{kind.idr, kind.parameter_sets, kind.b_slice};
  };
  EXPECT_EQ(told(unit_of({delimiter_nal, sequence_nal, picture_nal, idr_nal})),
            (std::array{true, true, false}));
  EXPECT_EQ(told(unit_of({delimiter_nal, idr_nal})), (std::array{true, false, false}));
  EXPECT_EQ(told(unit_of({p_nal})), (std::array{false, false, false}));
  EXPECT_EQ(told(unit_of({p_nal, b_nal})), (std::array{false, false, true}));
  EXPECT_EQ(told(unit_of({b_only_nal})), (std::array{false, false, true}));
  EXPECT_EQ(told({}), (std::array{false, false, false}));
  EXPECT_EQ(told({0, 0, 1}), (std::array{false, false, false}));
  EXPECT_EQ(told({0, 0, 1, 0x41}), (std::array{false, false, false})) << "a slice without a header";
}

TEST(H264Unit, EveryIdrGetsItsParameterSets) {
  ParameterSets sets;
  const auto kept = [&](const Bytes& unit) {
    const ByteView out = sets.complete(unit);
    return Bytes(out.begin(), out.end());
  };
  EXPECT_EQ(kept(unit_of({p_nal})), Bytes()) << "nothing to begin with";
  EXPECT_EQ(kept(unit_of({delimiter_nal, idr_nal})), Bytes()) << "no parameters yet";
  const Bytes key = unit_of({delimiter_nal, sequence_nal, picture_nal, idr_nal});
  EXPECT_EQ(kept(key), key);
  EXPECT_EQ(kept(unit_of({p_nal})), unit_of({p_nal}));
  EXPECT_EQ(kept(unit_of({delimiter_nal, idr_nal})), key) << "behind the delimiter";
  EXPECT_EQ(kept(unit_of({idr_nal})), unit_of({sequence_nal, picture_nal, idr_nal}));
  Bytes padded = unit_of({sequence_nal, picture_nal});
  padded.insert(padded.end(), 3, 0);
  sets.complete(padded);
  EXPECT_EQ(kept(unit_of({idr_nal})), unit_of({sequence_nal, picture_nal, idr_nal})) << "padding is not kept";
}

/// Columns from left to right over a view, with ranges that a test says.
struct View {
  std::vector<float> ranges, bearings;
  MetricEstimate metric;
  View(double left, double right, std::vector<float> values, double range_min = 1, double range_max = 8)
      : ranges(std::move(values)) {
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      // As a camera has them: equal steps of the tangent.
      const double middle = (left + right) / 2, half = std::tan((left - right) / 2);
      const double part =
          ranges.size() > 1 ? 1 - 2 * static_cast<double>(i) / static_cast<double>(ranges.size() - 1) : 0;
      bearings.push_back(
          static_cast<float>(std::remainder(middle + std::atan(part * half), 2 * std::numbers::pi)));
    }
    metric.ranges = metric.low = metric.high = ranges;
    metric.bearings = bearings;
    metric.height = 1;
    metric.yaw = std::remainder((left + right) / 2, 2 * std::numbers::pi);
    metric.range_min = range_min;
    metric.range_max = range_max;
  }
};

std::vector<float> random_ranges(std::mt19937& random, std::size_t columns) {
  std::vector<float> ranges;
  float value = 4;
  for (std::size_t i = 0; i < columns; ++i) {
    value = std::clamp(value + static_cast<float>(random() % 101) / 50 - 1, 1.5f, 8.0f);
    ranges.push_back(random() % 17 == 0 ? nan_value : random() % 11 == 0 ? inf_value : value);
  }
  return ranges;
}

/// Directions by which two angles differ, within half a turn.
double between(double a, double b) {
  return std::abs(std::remainder(a - b, 2 * std::numbers::pi));
}

TEST(Beams, AreTheLeastOfTheirColumns) {
  std::mt19937 random(3);
  for (const double yaw : {0.0, 0.4, std::numbers::pi, -2.0}) // behind: bearings jump from -pi to pi
    for (const ScanFan& fan :
         {ScanFan{yaw - 0.603, 0.0101, 121, 2.5}, ScanFan{yaw - 0.5, 0.041, 21, 0}, whole_circle(500, 1)}) {
      Beams beams;
      for (const std::size_t columns : {1u, 2u, 20u, 321u}) {
        View view(yaw + 0.6, yaw - 0.6, random_ranges(random, columns));
        view.metric.fan = fan;
        beams.take(view.metric);
        ASSERT_EQ(beams.ranges().size(), fan.beams);
        std::size_t told = 0;
        for (std::uint32_t beam = 0; beam < fan.beams; ++beam) {
          const double angle = fan.angle_min + beam * fan.increment;
          EXPECT_EQ(beams.beam_of(angle), beam);
          float least = inf_value;
          bool unknown = true, any = false;
          for (std::size_t i = 0; i < columns; ++i)
            if (between(view.bearings[i], angle) < fan.increment / 2 - 1e-9) {
              unknown = any ? unknown || std::isnan(view.ranges[i]) : std::isnan(view.ranges[i]);
              any = true;
              least = view.ranges[i] < least ? std::max(view.ranges[i], static_cast<float>(fan.range_min))
                                             : least;
            }
          const float range = beams.ranges()[beam];
          told += any;
          if (least == inf_value && unknown) {
            EXPECT_TRUE(std::isnan(range)) << beam << ": " << range;
          } else {
            EXPECT_EQ(range, least) << beam;
          }
        }
        EXPECT_GE(told, columns == 321 ? 20u : columns == 20 ? 10u : 0u);
      }
      if (fan.beams < 500) {
        EXPECT_EQ(beams.beam_of(yaw + std::numbers::pi), std::nullopt) << "behind the camera";
        EXPECT_EQ(beams.beam_of(yaw + 0.61 + fan.increment), std::nullopt) << "beside it";
      }
    }
}

TEST(Beams, KeepTheirGeometryWhateverTheFrameHas) {
  Beams beams;
  View first(0.5, -0.5, {2, 3, 4});
  first.metric.fan = {-0.6, 0.02, 61, 1};
  beams.take(first.metric);
  EXPECT_EQ(beams.fan(), first.metric.fan);
  const auto finite = [&] {
    return std::count_if(beams.ranges().begin(), beams.ranges().end(),
                         [](float r) { return std::isfinite(r); });
  };
  EXPECT_EQ(finite(), 3);
  EXPECT_EQ(beams.ranges()[beams.beam_of(-0.5).value()], 4) << "the right column";
  View other(0.8, -0.3, {2, 3, 4, 5});
  other.metric.fan = {-0.1, 0.5, 3, 0};
  beams.take(other.metric);
  EXPECT_EQ(beams.fan(), first.metric.fan);
  EXPECT_EQ(finite(), 3) << "the leftmost column is outside";
  // Nothing is known of this frame.
  std::fill(other.ranges.begin(), other.ranges.end(), nan_value);
  other.metric.bearings = other.ranges;
  beams.take(other.metric);
  ASSERT_EQ(beams.ranges().size(), 61u);
  EXPECT_TRUE(
      std::all_of(beams.ranges().begin(), beams.ranges().end(), [](float r) { return std::isnan(r); }));
}

TEST(Beams, AreAllAroundWhereNoFanIsStated) {
  Beams beams;
  const View view(0.5, -0.5, {2, 3, 4});
  beams.take(view.metric);
  EXPECT_EQ(beams.fan(), whole_circle(720, view.metric.range_min));
  EXPECT_EQ(beams.ranges()[beams.beam_of(0).value()], 3);
}

TEST(BoundaryPoints, AreWhereTheFreeSpaceEnds) {
  const View view(0.5, -0.5, {2, inf_value, 3, nan_value, 4});
  std::vector<BoundaryPoint> points;
  boundary_points(points, view.metric);
  ASSERT_EQ(points.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(std::hypot(points[i].x, points[i].y), 2 + static_cast<double>(i), 1e-5);
    EXPECT_NEAR(std::atan2(points[i].y, points[i].x), view.bearings[2 * i], 1e-5);
    EXPECT_EQ(points[i].z, 0);
  }
  EXPECT_GT(points[0].y, 0) << "the left column lies to the left";
}

TEST(FreeSpaceGrid, IsFreeOnlyBetweenTheNearestRowAndTheBoundary) {
  std::mt19937 random(5);
  for (const double yaw : {0.0, 1.0, std::numbers::pi}) {
    View view(yaw + 0.6, yaw - 0.6, random_ranges(random, 200));
    view.metric.fan = {yaw - 0.6, 0.01, 121, 1};
    Beams beams;
    beams.take(view.metric);
    FreeSpaceGrid drawer;
    drawer.draw(view.metric, beams, 0.1);
    const OccupancyGrid grid = drawer.grid();
    std::vector<std::pair<double, double>> ends;
    for (std::size_t i = 0; i < view.ranges.size(); ++i)
      if (std::isfinite(view.ranges[i]))
        ends.emplace_back(view.ranges[i] * std::cos(view.bearings[i]),
                          view.ranges[i] * std::sin(view.bearings[i]));
    ASSERT_EQ(grid.cells.size(), std::size_t{grid.width} * grid.height);
    std::size_t free_cells = 0, occupied = 0;
    for (std::size_t i = 0; i < grid.cells.size(); ++i) {
      const double x = grid.x + (static_cast<double>(i % grid.width) + 0.5) * grid.resolution;
      const double y = grid.y + (static_cast<double>(i / grid.width) + 0.5) * grid.resolution;
      const double range = std::hypot(x, y);
      const double ahead = x * std::cos(yaw) + y * std::sin(yaw); // metres along the camera's axis
      const auto number = beams.beam_of(std::atan2(y, x));
      const float* beam = number ? &beams.ranges()[*number] : nullptr;
      if (grid.cells[i] == 0) {
        ++free_cells;
        ASSERT_NE(beam, nullptr);
        EXPECT_GE(ahead, view.metric.range_min - 1e-4) << "under the picture's lower edge";
        EXPECT_TRUE(range < *beam) << range << " behind " << *beam;
        EXPECT_LE(range, view.metric.range_max + 1e-4);
      } else if (grid.cells[i] == 100) {
        ++occupied;
        bool at_an_end = beam && range >= *beam - 1e-4 && range <= *beam + 0.16;
        for (const auto& [end_x, end_y] : ends)
          at_an_end |= std::abs(end_x - x) <= 0.051 && std::abs(end_y - y) <= 0.051;
        EXPECT_TRUE(at_an_end) << x << ", " << y;
      } else {
        EXPECT_EQ(grid.cells[i], -1);
        if (beam && std::isfinite(*beam)) {
          EXPECT_FALSE(ahead > view.metric.range_min + 0.01 && range < *beam - 0.01) << "seen and free";
        }
      }
    }
    EXPECT_GT(free_cells, 500u);
    EXPECT_GT(occupied, 50u);
    // However narrow, each end of the free space is there.
    for (const auto& [x, y] : ends) {
      const auto column = static_cast<std::size_t>((x - grid.x) / grid.resolution);
      const auto row = static_cast<std::size_t>((y - grid.y) / grid.resolution);
      EXPECT_EQ(grid.cells[row * grid.width + column], 100) << x << ", " << y;
    }
  }
}

TEST(FreeSpaceGrid, HasAtMost512CellsASide) {
  View view(0.6, -0.6, std::vector<float>(50, 90), 1, 100);
  view.metric.fan = {-0.6, 0.01, 121, 1};
  Beams beams;
  beams.take(view.metric);
  FreeSpaceGrid drawer;
  EXPECT_EQ(drawer.grid().cells.size(), 0u);
  drawer.draw(view.metric, beams, 0.1);
  EXPECT_LE(std::max(drawer.grid().width, drawer.grid().height), 512u);
  EXPECT_DOUBLE_EQ(drawer.grid().resolution, 0.4);
}

TEST(FreeSpaceGrid, StaysWhereTheFanIs) {
  Beams beams;
  FreeSpaceGrid drawer;
  std::optional<std::array<double, 5>> geometry;
  for (const double turn : {0.0, 0.1, -0.3, 3.0}) {
    View view(turn + 0.5, turn - 0.5, std::vector<float>(50, 5), 1 + std::abs(turn));
    view.metric.fan = {-0.6, 0.01, 121, 1};
    if (turn == -0.3) {
      std::fill(view.ranges.begin(), view.ranges.end(), nan_value);
      view.metric.bearings = view.ranges;
    }
    beams.take(view.metric);
    drawer.draw(view.metric, beams, 0.1);
    const OccupancyGrid g = drawer.grid();
    const std::array<double, 5> now{g.resolution, static_cast<double>(g.width), static_cast<double>(g.height),
                                    g.x, g.y};
    EXPECT_EQ(now, geometry.value_or(now)) << turn;
    geometry = now;
  }
}

/// What a quaternion makes of a vector, by its matrix.
std::array<double, 3> rotated(const std::array<double, 4>& q, const std::array<double, 3>& v) {
  const auto [x, y, z, w] = q;
  return {(1 - 2 * (y * y + z * z)) * v[0] + 2 * (x * y - w * z) * v[1] + 2 * (x * z + w * y) * v[2],
          2 * (x * y + w * z) * v[0] + (1 - 2 * (x * x + z * z)) * v[1] + 2 * (y * z - w * x) * v[2],
          2 * (x * z - w * y) * v[0] + 2 * (y * z + w * x) * v[1] + (1 - 2 * (x * x + y * y)) * v[2]};
}

struct ReadTransform {
  std::string parent, child;
  std::array<double, 3> translation;
  std::array<double, 4> rotation;
};

ReadTransform read_transform(const Bytes& data) {
  Reader r(data);
  r.view(4);
  EXPECT_EQ(r.take<std::uint32_t>(), 1u);
  r.view(8);
  ReadTransform t;
  t.parent = r.string();
  r.align(4);
  t.child = r.string();
  r.align(8);
  for (double& value : t.translation)
    value = r.take<double>();
  for (double& value : t.rotation)
    value = r.take<double>();
  EXPECT_TRUE(r.over());
  return t;
}

/// One frame of a small recording, read back by topic.
std::map<std::string, Bytes> record_one(const MessageFrame& frame, MessageOptions options,
                                        std::string* yaml = nullptr) {
  Disk disk;
  TerrainRecording recording(disk.sink(), std::move(options));
  recording.add(frame);
  recording.finish();
  if (yaml)
    *yaml = recording.bag_metadata("a \"b\"\n.mcap");
  const ReadFile file = read_file(disk.bytes);
  EXPECT_TRUE(file.whole);
  std::map<std::string, Bytes> found;
  for (const ReadMessage& m : file.messages) {
    EXPECT_EQ(m.time, frame.time);
    found[file.topics.at(m.channel)] = m.data;
  }
  return found;
}

TEST(TerrainRecording, TransformIsThatOfTheProjection) {
  MessageOptions options;
  options.mount = metric::Mount{0.7, 0.2, 0.1, 0.3, 0.4, -0.1};
  MessageFrame frame;
  frame.time = 5;
  const ReadTransform t = read_transform(record_one(frame, options).at("/tf"));
  EXPECT_EQ(t.parent, "base_link\0"s);
  EXPECT_EQ(t.child, "camera_optical\0"s);
  EXPECT_EQ(t.translation, (std::array{0.4, -0.1, 0.7}));
  // The ray through an image point meets the ground where the projection says.
  const metric::GroundProjection projection(*options.mount);
  for (const metric::ImagePoint& p : {metric::ImagePoint{0, 0.3}, {0.4, 0.5}, {-0.5, 0.2}}) {
    const auto ray = rotated(t.rotation, {p.x, p.y, 1});
    const double length = t.translation[2] / -ray[2];
    const auto point = projection(p);
    ASSERT_TRUE(point);
    EXPECT_NEAR(t.translation[0] + length * ray[0], point->x, 1e-9);
    EXPECT_NEAR(t.translation[1] + length * ray[1], point->y, 1e-9);
  }
}

TEST(TerrainRecording, TheAttitudeOfTheMomentReplacesTheMounts) {
  MessageOptions options;
  options.mount = metric::Mount{0.7, 0.2};
  View view(0.5, -0.5, {2, 3, 4});
  view.metric.pitch = 0.5;
  view.metric.yaw = 0;
  view.metric.height = 0.9;
  MessageFrame frame;
  frame.metric = &view.metric;
  const ReadTransform t = read_transform(record_one(frame, options).at("/tf"));
  const auto forward = rotated(t.rotation, {0, 0, 1}), right = rotated(t.rotation, {1, 0, 0});
  EXPECT_NEAR(forward[0], std::cos(0.5), 1e-12);
  EXPECT_NEAR(forward[2], -std::sin(0.5), 1e-12) << "positive pitch looks down";
  EXPECT_NEAR(right[1], -1, 1e-12);
  EXPECT_EQ(t.translation[2], 0.9);
}

/// Keeps the messages of the topics that it wants.
struct Kept : MessageOutlet {
  std::set<Topic> wanted;
  std::vector<std::pair<Topic, Bytes>> messages;
  bool wants(Topic topic) override { return wanted.count(topic) != 0; }
  void put(Topic topic, std::uint64_t, ByteView message) override {
    messages.emplace_back(topic, Bytes(message.begin(), message.end()));
  }
};

TEST(TerrainMessages, TheAttitudeSaysWhichTransformItIs) {
  MessageOptions options;
  options.mount = metric::Mount{0.7, 0.2};
  TerrainMessages messages(options);
  Kept kept;
  kept.wanted = {Topic::tf, Topic::tf_static};
  View view(0.5, -0.5, {2, 3, 4});
  MessageFrame frame;
  messages.add(frame, kept);
  frame.metric = &view.metric;
  messages.add(frame, kept);
  view.metric.flags = metric_flag_pose;
  messages.add(frame, kept);
  ASSERT_EQ(kept.messages.size(), 3u);
  EXPECT_EQ(kept.messages[0].first, Topic::tf_static);
  EXPECT_EQ(kept.messages[1].first, Topic::tf_static);
  EXPECT_EQ(kept.messages[2].first, Topic::tf);
}

TEST(TerrainMessages, AScanIsTheSameWhetherTheOthersAreWantedOrNot) {
  std::vector<Bytes> scans;
  for (const bool alone : {false, true}) {
    TerrainMessages messages{MessageOptions()};
    Kept kept;
    kept.wanted = {Topic::scan};
    View view(0.5, -0.5, {2, 3, 4});
    for (std::uint64_t i = 0; i < 3; ++i) {
      if (!alone && i < 2)
        kept.wanted = i == 0 ? std::set{Topic::points, Topic::grid} : std::set<Topic>();
      else
        kept.wanted = {Topic::scan};
      MessageFrame frame;
      frame.time = i * 100'000'000;
      frame.metric = &view.metric;
      messages.add(frame, kept);
    }
    scans.push_back(kept.messages.back().second);
  }
  EXPECT_EQ(scans[0], scans[1]) << "scan_time counts frames, not messages";
}

TEST(TerrainMessages, DiagnosticsComeWithAChangeAndOnceASecond) {
  TerrainMessages messages{MessageOptions()};
  Kept kept;
  kept.wanted = {Topic::diagnostics};
  Estimate e;
  e.frame_width = e.frame_height = 8;
  MessageFrame frame;
  frame.estimate = &e;
  const auto add = [&](std::uint64_t milliseconds, std::uint32_t flags, std::optional<bool> near_clear) {
    e.flags = flags;
    e.confidence = static_cast<std::uint8_t>(milliseconds % 251);
    frame.time = milliseconds * 1'000'000;
    frame.near_clear = near_clear;
    const std::size_t before = kept.messages.size();
    messages.add(frame, kept);
    return kept.messages.size() - before;
  };
  EXPECT_EQ(add(0, flag_unknown, {}), 1u);
  EXPECT_EQ(add(33, flag_unknown, {}), 0u) << "only the confidence is another";
  EXPECT_EQ(add(66, flag_learned, {}), 1u);
  EXPECT_EQ(add(99, flag_learned, false), 1u);
  EXPECT_EQ(add(1098, flag_learned, false), 0u);
  EXPECT_EQ(add(1099, flag_learned, false), 1u) << "a second";
  EXPECT_EQ(add(50, flag_learned, false), 1u) << "time went back";
  Reader r(kept.messages[2].second);
  r.view(4 + 8);
  EXPECT_EQ(r.string(), "base_link\0"s);
  r.align(4);
  EXPECT_EQ(r.take<std::uint32_t>(), 1u);
  EXPECT_EQ(r.take<std::uint8_t>(), DiagnosticStatus::ok);
  std::vector<std::string> texts;
  for (int i = 0; i < 3; ++i) {
    r.align(4);
    texts.push_back(r.string());
  }
  EXPECT_EQ(texts, (std::vector{"terrainseg: terrain\0"s, "terrain is known\0"s, "\0"s}));
  r.align(4);
  const auto count = r.take<std::uint32_t>();
  std::map<std::string, std::string> values;
  for (std::uint32_t i = 0; i < count; ++i) {
    r.align(4);
    const std::string key = r.string();
    r.align(4);
    values[key] = r.string();
  }
  EXPECT_TRUE(r.over());
  EXPECT_EQ(values.at("learning\0"s), "learning\0"s);
  EXPECT_EQ(values.at("near_clear\0"s), "false\0"s);
  EXPECT_EQ(values.at("confidence\0"s), "99\0"s);
}

TEST(TerrainMessages, APictureIsTheFileItself) {
  TerrainMessages messages{MessageOptions()};
  Kept kept;
  kept.wanted = {Topic::picture};
  const Bytes file = {0xff, 0xd8, 1, 2, 3, 0xff, 0xd9};
  MessageFrame frame;
  frame.time = 7;
  frame.picture = file;
  messages.add(frame, kept);
  ASSERT_EQ(kept.messages.size(), 1u);
  Reader r(kept.messages[0].second);
  r.view(4 + 8);
  EXPECT_EQ(r.string(), "camera_optical\0"s);
  r.align(4);
  EXPECT_EQ(r.string(), "jpeg\0"s);
  r.align(4);
  const ByteView data = r.view(r.take<std::uint32_t>());
  EXPECT_EQ(Bytes(data.begin(), data.end()), file);
  EXPECT_TRUE(r.over());
}

TEST(TerrainRecording, WritesOnlyWhatIsKnown) {
  MessageFrame frame;
  EXPECT_EQ(record_one(frame, {}).size(), 0u);
  std::vector<std::uint8_t> pixels(6 * 4, 255); // four columns of a stride of six
  Estimate e;
  e.frame_width = 8;
  e.frame_height = 8;
  e.mask = {{pixels.data(), 6}, 4, 4};
  frame.estimate = &e;
  const auto plain = record_one(frame, {});
  ASSERT_EQ(plain.size(), 2u);
  EXPECT_EQ(plain.begin()->first, "/diagnostics");
  EXPECT_EQ(plain.at("/terrain/mask").size() % 4, 0u);
  MessageOptions options;
  options.camera = metric::Camera{16, 16, 10, 10, 7.5, 7.5, {}, {}};
  options.mount = metric::Mount{1};
  const View view(0.5, -0.5, {2, 3, 4});
  frame.metric = &view.metric;
  const Bytes key = unit_of({sequence_nal, picture_nal, idr_nal});
  frame.video = key;
  frame.time = 1'700'000'000'123'456'789;
  std::string yaml;
  const auto all = record_one(frame, options, &yaml);
  EXPECT_EQ(all.size(), 8u);
  // Scaled to the frame: half of the calibration's picture.
  Reader info(all.at("/camera/camera_info"));
  info.view(4);
  EXPECT_EQ(info.take<std::int32_t>(), 1'700'000'000);
  EXPECT_EQ(info.take<std::uint32_t>(), 123'456'789u);
  info.string();
  info.align(4);
  EXPECT_EQ(info.take<std::uint32_t>(), 8u);
  EXPECT_EQ(info.take<std::uint32_t>(), 8u);
  EXPECT_EQ(info.string(), "plumb_bob\0"s);
  info.align(4);
  EXPECT_EQ(info.take<std::uint32_t>(), 5u);
  info.align(8);
  info.view(5 * 8);
  EXPECT_EQ(info.take<double>(), 5.0);

  const YAML::Node bag = YAML::Load(yaml)["rosbag2_bagfile_information"];
  EXPECT_EQ(bag["storage_identifier"].as<std::string>(), "mcap");
  EXPECT_EQ(bag["message_count"].as<int>(), 8);
  EXPECT_EQ(bag["topics_with_message_count"].size(), 8u);
  EXPECT_EQ(bag["starting_time"]["nanoseconds_since_epoch"].as<std::uint64_t>(), frame.time);
  EXPECT_EQ(bag["duration"]["nanoseconds"].as<std::uint64_t>(), 0u);
  EXPECT_EQ(bag["relative_file_paths"][0].as<std::string>(), "a \"b\"\n.mcap");
  EXPECT_EQ(bag["files"][0]["path"].as<std::string>(), "a \"b\"\n.mcap");
}

} // namespace
} // namespace terrainseg::recording
