// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames with metadata of any kind and access units of any bytes into terrainmcapsink, with caps, gaps,
// flushes, segments, ends, stops and full disks between them. What is recorded is whole wherever the disk
// took it, and read here by the words of MCAP's specification.
#include <yaml-cpp/yaml.h>
#include <zstd.h>

#include <fcntl.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "exchange/bytes.hpp"
#include "metadata_input.hpp"
#include "support/elements.hpp"

namespace {

namespace fs = std::filesystem;
using namespace terrainseg;
using namespace terrainseg::fuzz;
using Bytes = std::vector<std::uint8_t>;
using ByteView = std::span<const std::uint8_t>;

// ---- what was recorded -----------------------------------------------------------------------------------

/// Takes numbers, least significant byte first, and texts off the front.
class Reader {
 public:
  explicit Reader(ByteView bytes) : left_(bytes) {}
  std::uint64_t number(std::size_t bytes) {
    std::uint64_t value = 0;
    const ByteView taken = view(bytes);
    for (std::size_t i = bytes; i-- > 0;)
      value = value << 8 | taken[i];
    return value;
  }
  ByteView view(std::uint64_t bytes) {
    require(bytes <= left_.size());
    const ByteView front = left_.first(bytes);
    left_ = left_.subspan(bytes);
    return front;
  }
  ByteView string() { return view(number(4)); }
  std::size_t left() const { return left_.size(); }

 private:
  ByteView left_;
};

/// Records of a file or a chunk, one after the other, which must come out even.
struct Records {
  std::set<std::uint64_t> schemas, channels;
  std::uint64_t messages = 0, chunks = 0;
  bool data_ended = false, ended = false;
  std::map<std::uint64_t, std::uint64_t> of_channel;

  void read(ByteView bytes) {
    for (Reader r(bytes); r.left() > 0;) {
      require(!ended);
      const std::uint64_t kind = r.number(1);
      take(kind, r.view(r.number(8)));
    }
  }

 private:
  void take(std::uint64_t kind, ByteView content) {
    Reader r(content);
    switch (kind) {
    case 0x03:
      schemas.insert(r.number(2));
      break;
    case 0x04: {
      const std::uint64_t channel = r.number(2);
      require(schemas.count(r.number(2)) == 1);
      channels.insert(channel);
      break;
    }
    case 0x05: {
      const std::uint64_t channel = r.number(2);
      require(channels.count(channel) == 1 && r.number(4) == of_channel[channel]++);
      r.view(16);
      const ByteView message = r.view(r.left());
      require(message.size() > 4 && message[0] == 0 && message[1] == 1); // CDR, little endian
      ++messages;
      break;
    }
    case 0x06:
      take_chunk(r);
      break;
    case 0x0b:
      require(r.number(8) == messages && r.number(2) == channels.size() && r.number(4) == channels.size());
      r.view(8);
      require(r.number(4) == chunks);
      break;
    case 0x0f:
      data_ended = true;
      break;
    case 0x02:
      require(data_ended && content.size() == 20);
      ended = true;
      break;
    default:
      require(kind == 0x01 || kind == 0x07 || kind == 0x08 || kind == 0x0e);
      break;
    }
  }
  void take_chunk(Reader& r) {
    const std::uint64_t start = r.number(8), end = r.number(8), size = r.number(8), sum = r.number(4);
    require(start <= end && size <= std::uint64_t{1} << 28);
    const ByteView zstd = r.string();
    require(std::string(zstd.begin(), zstd.end()) == "zstd");
    const ByteView packed = r.view(r.number(8));
    require(r.left() == 0);
    Bytes records(size);
    require(ZSTD_decompress(records.data(), records.size(), packed.data(), packed.size()) == size);
    require(crc32(records) == sum);
    read(records);
    ++chunks;
  }
};

/// A recording that is whole; how many messages it holds.
std::uint64_t messages_of(ByteView bytes) {
  constexpr std::uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
  require(bytes.size() >= 2 * sizeof magic && std::memcmp(bytes.data(), magic, sizeof magic) == 0 &&
          std::memcmp(&bytes[bytes.size() - sizeof magic], magic, sizeof magic) == 0);
  Records records;
  records.read(bytes.subspan(sizeof magic, bytes.size() - 2 * sizeof magic));
  require(records.ended);
  return records.messages;
}

Bytes bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// A metadata.yaml that counts the messages.
void check_bag(const std::string& text, std::uint64_t messages) {
  const YAML::Node bag = YAML::Load(text)["rosbag2_bagfile_information"];
  require(bag["message_count"].as<std::uint64_t>() == messages);
}

// ---- what is done ----------------------------------------------------------------------------------------

/// The sink's own; where it writes, and what it reads, is chosen elsewhere.
bool may_set(const GParamSpec* spec) {
  static const GType own = g_type_from_name("GstTerrainMcapSink");
  for (const char* name : {"location", "fd", "camera-info", "mount"})
    if (std::strcmp(spec->name, name) == 0)
      return false;
  return spec->owner_type == own;
}

/// A folder that goes with the process.
const fs::path& folder() {
  static const fs::path path = [] {
    gchar* made = g_dir_make_tmp("terrainseg-fuzz-XXXXXX", nullptr);
    require(made != nullptr);
    const fs::path name = made;
    g_free(made);
    return name;
  }();
  static const bool gone = std::atexit([] {
                             std::error_code ignored;
                             fs::remove_all(path, ignored);
                           }) == 0;
  require(gone);
  return path;
}

class Session {
 public:
  explicit Session(Input& in) : in_(in), element_(gst_element_factory_make("terrainmcapsink", nullptr)) {
    require(element_ != nullptr);
    gst_object_ref_sink(element_);
    g_object_set(element_, "async", FALSE, nullptr);
    src_ = gst_pad_new("src", GST_PAD_SRC);
    GstPad* sink = gst_element_get_static_pad(element_, "sink");
    require(gst_pad_link(src_, sink) == GST_PAD_LINK_OK);
    gst_object_unref(sink);
    gst_pad_set_active(src_, TRUE);
    begin();
  }
  ~Session() {
    end();
    gst_pad_set_active(src_, FALSE);
    gst_object_unref(element_);
    gst_object_unref(src_);
  }

  void step() {
    switch (in_.byte() % 16) {
    case 0:
      push_caps();
      break;
    case 1:
      set_property_from(in_, G_OBJECT(element_), may_set);
      break;
    case 2:
      flush(src_, in_);
      break;
    case 3:
      gst_pad_push_event(src_, segment_from(in_));
      break;
    case 4:
      gst_pad_push_event(src_, gst_event_new_gap(in_.number(5), time_from(in_, 1)));
      break;
    case 5:
      if (in_.chance(4))
        gst_pad_push_event(src_, gst_event_new_eos());
      else
        gst_pad_push_event(src_, gst_event_new_stream_start("x"));
      break;
    case 6:
      if (in_.chance(4)) {
        end();
        begin();
      }
      break;
    default:
      push_frame();
      break;
    }
  }

 private:
  enum class Target : std::uint8_t { file, bag, descriptor, full, nowhere };

  void begin() {
    for (int i = in_.byte() % 4; i > 0; --i)
      set_property_from(in_, G_OBJECT(element_), may_set);
    calibrate();
    static constexpr Target targets[] = {Target::file, Target::file,       Target::file, Target::bag,
                                         Target::bag,  Target::descriptor, Target::full, Target::nowhere};
    target_ = targets[in_.byte() % std::size(targets)];
    std::string location;
    if (target_ == Target::file)
      location = folder() / "drive.mcap";
    else if (target_ == Target::bag)
      location = folder() / "drive";
    else if (target_ == Target::descriptor)
      fd_ = open((folder() / "descriptor").c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    else if (target_ == Target::full)
      fd_ = open("/dev/full", O_WRONLY | O_CLOEXEC);
    g_object_set(element_, "location", location.empty() ? nullptr : location.c_str(), "fd", fd_, nullptr);
    const bool taken = target_ != Target::nowhere && in_.chance(16);
    const fs::path there = folder() / (target_ == Target::bag ? "drive/metadata.yaml" : "drive.mcap.part");
    if (taken) {
      fs::create_directories(there.parent_path());
      std::ofstream(there) << "another's";
    }
    started_ = gst_element_set_state(element_, GST_STATE_PLAYING) != GST_STATE_CHANGE_FAILURE;
    const bool opens =
        target_ != Target::nowhere && !(taken && (target_ == Target::file || target_ == Target::bag));
    require(started_ == opens);
    if (taken) {
      const Bytes kept = bytes_of(there);
      require(std::string(kept.begin(), kept.end()) == "another's");
      fs::remove(there);
    }
    gst_pad_push_event(src_, gst_event_new_stream_start("video"));
    if (in_.chance(16)) // frames before any caps
      return;
    push_caps();
    gst_pad_push_event(src_, segment_from(in_));
  }

  /// Stops, and reads what is there.
  void end() {
    const GstStateChangeReturn stopped = gst_element_set_state(element_, GST_STATE_NULL);
    gchar* said = nullptr;
    g_object_get(element_, "bag-metadata", &said, nullptr);
    const std::string metadata = said ? said : "";
    g_free(said);
    if (fd_ >= 0)
      close(fd_);
    fd_ = -1;
    if (started_ && target_ != Target::full) {
      require(stopped == GST_STATE_CHANGE_SUCCESS);
      const char* const names[] = {"drive.mcap", "drive/drive_0.mcap", "descriptor"};
      const Bytes bytes = bytes_of(folder() / names[static_cast<int>(target_)]);
      check_bag(metadata, messages_of(bytes));
      if (target_ == Target::bag) {
        const Bytes kept = bytes_of(folder() / "drive/metadata.yaml");
        require(std::string(kept.begin(), kept.end()) == metadata);
      }
      for (const auto& file : fs::recursive_directory_iterator(folder()))
        require(file.path().extension() != ".part");
    }
    started_ = false;
    for (const auto& file : fs::directory_iterator(folder()))
      fs::remove_all(file.path());
  }

  void calibrate() {
    const std::uint8_t what = in_.byte();
    g_object_set(element_, "camera-info", what % 4 == 1 ? camera_info_file().c_str() : nullptr, "mount",
                 what % 8 == 5 || what % 8 == 2 ? "height=0.5,pitch=20deg,yaw=3deg,x=0.1" : nullptr, nullptr);
  }

  void push_caps() {
    encoded_ = in_.byte() & 1;
    GstCaps* caps = gst_caps_from_string(encoded_ ? "video/x-h264,stream-format=byte-stream,alignment=au"
                                                  : caps_from(in_).c_str());
    GstVideoInfo info;
    width_ = height_ = 0;
    if (!encoded_ && gst_video_info_from_caps(&info, caps)) {
      width_ = GST_VIDEO_INFO_WIDTH(&info);
      height_ = GST_VIDEO_INFO_HEIGHT(&info);
    } else if (encoded_ && in_.chance(8)) {
      gst_caps_unref(caps);
      caps = gst_caps_from_string("video/x-h264,stream-format=avc");
    }
    gst_pad_push_event(src_, gst_event_new_caps(caps));
    gst_caps_unref(caps);
  }

  /// Parameter sets, pictures and what is none, after start codes of three bytes or four, or after none.
  Bytes access_unit() {
    static constexpr std::uint8_t headers[] = {0x67, 0x68, 0x65, 0x41, 0x09, 0x06, 0x01, 0x00};
    Bytes unit;
    for (int i = in_.byte() % 6; i > 0; --i) {
      const std::uint8_t what = in_.byte();
      if (what & 8)
        unit.push_back(0);
      if ((what >> 4) != 15)
        unit.insert(unit.end(), {0, 0, 1});
      unit.push_back(headers[what % std::size(headers)]);
      const auto content = in_.take(in_.byte() % 12);
      unit.insert(unit.end(), content.begin(), content.end());
    }
    return unit;
  }

  void push_frame() {
    const Bytes bytes = encoded_ ? access_unit() : Bytes(in_.byte());
    GstBuffer* frame = gst_buffer_new_allocate(nullptr, bytes.size(), nullptr);
    gst_buffer_fill(frame, 0, bytes.data(), bytes.size());
    metadata_.attach_to(frame, in_, frames_, width_, height_);
    set_times(frame, in_, frames_);
    ++frames_;
    gst_pad_push(src_, frame);
  }

  Input& in_;
  GstElement* element_;
  GstPad* src_ = nullptr;
  Target target_ = Target::nowhere;
  int fd_ = -1;
  bool started_ = false, encoded_ = false;
  int width_ = 0, height_ = 0;
  EstimateInput metadata_;
  guint64 frames_ = 0;
};

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  start_gstreamer();
  require(GST_ELEMENT_REGISTER(terrainmcapsink, nullptr));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return play<Session>(data, size, 24);
}
