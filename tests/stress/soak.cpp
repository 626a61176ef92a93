// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs pipelines of many sizes, formats, streams, scenes and links with loss in one process for a long time,
// and fails when memory, descriptors, threads or the latency of a frame grow, or when a frame is lost.
//
//   soak SECONDS [CSV [memory|descriptors|threads|latency]]
//
// CSV gets one row a round. The last argument makes the program leak on purpose: to see that it is found.
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "program.hpp"

namespace terrainseg::test {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr std::array formats = {"I420", "YV12", "NV12", "NV21", "Y42B", "Y444", "YUY2", "UYVY", "RGB",
                                "BGR",  "RGBx", "BGRx", "xRGB", "xBGR", "RGBA", "BGRA", "ARGB", "ABGR"};
constexpr std::array sizes = {"width=64,height=48", "width=97,height=65", "width=160,height=120",
                              "width=320,height=180"};
constexpr std::array scenes = {"scene=road", "scene=trail motion=bumpy", "scene=corridor light=dusk"};
/// What stands between the frames and the sink.
constexpr std::array filters = {
    "terrainseg name=f",
    "terrainseg name=f preset=paper",
    "terrainseg name=f overlay=true post-messages=true",
    "terrainseg name=f reset-on=per-stream ! terrainextract ! application/x-ndjson",
    "terrainseg name=f mask-level=2 n-threads=2 ! terrainextract ! meta/x-klv,parsed=true",
    "terrainseg name=f ! queue ! terrainoverlay ! terrainextract ! video/x-raw,format=GRAY8"};
constexpr int rendered = 8;          ///< frames of each scene, size and format
constexpr int frames_of_a_leg = 240; ///< in a filter's leg
constexpr int frames_of_a_link = 60; ///< through an encoder and a lossy link
constexpr int frames_of_a_scene = 60;

/// Nanoseconds that frames took, in steps of 4 %.
class Histogram {
 public:
  void add(std::uint64_t ns) {
    std::size_t step = 0;
    for (double limit = 1000; limit < static_cast<double>(ns) && step + 1 < counts_.size(); limit *= 1.04)
      ++step;
    ++counts_[step];
    ++total_;
  }
  void add(const Histogram& other) {
    for (std::size_t i = 0; i < counts_.size(); ++i)
      counts_[i] += other.counts_[i];
    total_ += other.total_;
  }
  /// Milliseconds that all but a thousandth stay under.
  double p999() const {
    std::uint64_t above = total_ / 1000, seen = 0;
    double limit = 1000;
    for (std::size_t i = 0; i < counts_.size(); ++i)
      limit *= 1.04;
    for (std::size_t i = counts_.size(); i-- > 0; limit /= 1.04)
      if ((seen += counts_[i]) > above)
        break;
    return limit / 1e6;
  }

 private:
  std::array<std::uint64_t, 400> counts_{};
  std::uint64_t total_ = 0;
};

std::uint64_t now(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<std::uint64_t>(t.tv_sec) * 1000000000u + static_cast<std::uint64_t>(t.tv_nsec);
}

/// What the filter's own thread takes for a frame, on the wall and of the processor. One thread writes.
struct Stopwatch {
  Histogram wall, processor;
  std::uint64_t wall_begin = 0, processor_begin = 0;
  std::uint64_t added_ns = 0; ///< the latency that is made to grow

  void add(const Stopwatch& other) {
    wall.add(other.wall);
    processor.add(other.processor);
  }
  void watch(const Pipeline& pipeline) {
    gst_pad_add_probe(
        pipeline.pad("f", "sink").get(), GST_PAD_PROBE_TYPE_BUFFER,
        [](GstPad*, GstPadProbeInfo*, gpointer data) {
          auto* self = static_cast<Stopwatch*>(data);
          self->wall_begin = now(CLOCK_MONOTONIC);
          self->processor_begin = now(CLOCK_THREAD_CPUTIME_ID);
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
    gst_pad_add_probe(
        pipeline.pad("f", "src").get(), GST_PAD_PROBE_TYPE_BUFFER,
        [](GstPad*, GstPadProbeInfo*, gpointer data) {
          auto* self = static_cast<Stopwatch*>(data);
          self->wall.add(now(CLOCK_MONOTONIC) - self->wall_begin + self->added_ns);
          self->processor.add(now(CLOCK_THREAD_CPUTIME_ID) - self->processor_begin + self->added_ns);
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
  }
};

struct Round {
  double seconds = 0;
  std::uint64_t frames = 0; ///< since the start
  double rss_mib = 0;
  double used_mib = 0; ///< what the allocator has given out
  long descriptors = 0, threads = 0;
};

long entries(const char* folder) {
  return std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator());
}

/// The process while no pipeline is there.
void measure(Round& round) {
  g_thread_pool_stop_unused_threads();
  // Threads need a moment to be gone.
  for (long before = -1, same = 0; same < 3;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const long threads = entries("/proc/self/task");
    same = threads == before ? same + 1 : 0;
    before = threads;
  }
  malloc_trim(0);
  std::ifstream statm("/proc/self/statm");
  double total = 0, resident = 0;
  statm >> total >> resident;
  round.rss_mib = resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1048576;
  const struct mallinfo2 heap = mallinfo2();
  round.used_mib = static_cast<double>(heap.uordblks + heap.hblkhd) / 1048576;
  round.descriptors = entries("/proc/self/fd");
  round.threads = entries("/proc/self/task");
}

class Soak {
 public:
  Soak(Seconds length, std::string leak) : length_(length), leak_(std::move(leak)) {
    for (const char* scene : scenes) {
      for (const char* format : formats)
        for (const char* size : sizes)
          frames_.push_back(
              render(scene, std::string("video/x-raw,format=") + format + "," + size, rendered));
    }
  }

  std::vector<Round> run(std::FILE* csv) {
    const auto begin = std::chrono::steady_clock::now();
    const auto since = [&] { return Seconds(std::chrono::steady_clock::now() - begin); };
    std::vector<Round> rounds;
    rounds.reserve(static_cast<std::size_t>(4 * length_.count()) + 10);
    double told = 0;
    if (csv)
      std::fprintf(csv, "seconds,frames,rss_mib,used_mib,descriptors,threads,p999_ms,p999_cpu_ms\n");
    while (since() < length_ || rounds.size() < 10) {
      Round round;
      for (int i = 0; i < 4; ++i)
        filter_leg(filters[random_() % filters.size()], random_(), nullptr);
      link_leg();
      Stopwatch stopwatch;
      stopwatch.added_ns = leak_ == "latency" ? 400000 * rounds.size() * rounds.size() : 0;
      filter_leg("terrainseg name=f", 3, &stopwatch); // always the same frames: I420, 320x180
      // In place: what the program itself keeps must not grow.
      const auto tenth = std::min<std::size_t>(9, static_cast<std::size_t>(10 * since() / length_));
      tenths_[tenth].add(stopwatch);
      leak();
      measure(round);
      round.seconds = since().count();
      round.frames = frames_through_;
      if (csv) {
        std::fprintf(csv, "%.1f,%llu,%.2f,%.3f,%ld,%ld,%.2f,%.2f\n", round.seconds,
                     static_cast<unsigned long long>(round.frames), round.rss_mib, round.used_mib,
                     round.descriptors, round.threads, stopwatch.wall.p999(), stopwatch.processor.p999());
        std::fflush(csv);
      }
      if (round.seconds - told >= 60) {
        told = round.seconds;
        std::printf("%6.0f s: %llu frames, %.1f MiB, %ld descriptors, %ld threads\n", told,
                    static_cast<unsigned long long>(round.frames), round.rss_mib, round.descriptors,
                    round.threads);
        std::fflush(stdout);
      }
      rounds.push_back(round);
    }
    return rounds;
  }

  /// What the reference legs of each tenth of the time took.
  const std::array<Stopwatch, 10>& tenths() const { return tenths_; }

 private:
  const Frames& at(std::size_t scene, std::size_t kind) const {
    const std::size_t kinds = formats.size() * sizes.size();
    return frames_[scene % scenes.size() * kinds + kind % kinds];
  }

  /// Frames of one kind, other scenes and streams in between; every one has to come out.
  void filter_leg(const std::string& filter, std::size_t kind, Stopwatch* stopwatch) {
    watchdog_.step("frames through a filter");
    const Pipeline pipeline("appsrc name=in format=time max-buffers=4 block=true caps=\"" + at(0, kind).caps +
                            ",framerate=30/1\" ! " + filter + " ! fakesink name=out");
    if (stopwatch)
      stopwatch->watch(pipeline);
    std::atomic<std::uint64_t> out = 0;
    count_buffers(pipeline.pad("out", "sink").get(), out);
    pipeline.play();
    feed(pipeline, kind, frames_of_a_leg, true);
    if (!pipeline.wait(std::chrono::seconds(60)))
      give_up(filter + " does not come to its end");
    if (out != frames_of_a_leg)
      give_up(filter + ": " + std::to_string(out) + " of " + std::to_string(frames_of_a_leg) + " came out");
    if (Owned<GstMessage> warning{gst_bus_pop_filtered(pipeline.bus(), GST_MESSAGE_WARNING)})
      give_up(filter + ": " + Pipeline::text_of(warning.get()));
    frames_through_ += frames_of_a_leg;
  }

  /// Through an encoder, a transport stream that loses packets, a decoder, and back to its metadata.
  void link_leg() {
    watchdog_.step("frames through a link with loss");
    const std::size_t kind = 2; // I420, 160x120
    const Pipeline pipeline(
        "appsrc name=in format=time max-buffers=4 block=true caps=\"" + at(0, kind).caps +
        ",framerate=30/1\" ! terrainseg name=f ! tee name=t "
        "t. ! queue ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=10 threads=1 ! h264parse "
        "config-interval=-1 ! queue ! mux. "
        "t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! queue ! mux. "
        "mpegtsmux name=mux alignment=7 ! identity name=loss drop-probability=" +
        std::to_string(random_() % 2 ? 0.02 : 0.0) +
        " ! queue ! tsdemux name=d d. ! queue ! h264parse ! avdec_h264 max-threads=1 ! c.sink "
        "d. ! queue ! meta/x-klv ! c.meta terraincombine name=c ! terrainoverlay ! fakesink name=out");
    std::atomic<std::uint64_t> in = 0, out = 0;
    count_buffers(pipeline.pad("c", "sink").get(), in);
    count_buffers(pipeline.pad("out", "sink").get(), out);
    pipeline.play();
    feed(pipeline, kind, frames_of_a_link, false);
    if (!pipeline.wait(std::chrono::seconds(60)))
      give_up("the link does not come to its end");
    if (in != out)
      give_up("terraincombine took " + std::to_string(in) + " frames and gave " + std::to_string(out));
    frames_through_ += frames_of_a_link;
  }

  void feed(const Pipeline& pipeline, std::size_t kind, int count, bool with_streams) {
    GstAppSrc* in = GST_APP_SRC(pipeline.find("in"));
    if (with_streams)
      gst_pad_add_probe(pipeline.pad("in", "src").get(), GST_PAD_PROBE_TYPE_BUFFER, begin_streams, nullptr,
                        nullptr);
    for (int i = 0; i < count; ++i) {
      watchdog_.step("pushing frames");
      const auto& ring = at(static_cast<std::size_t>(i / frames_of_a_scene), kind).buffers;
      GstBuffer* buffer = gst_buffer_copy(ring[static_cast<std::size_t>(i) % ring.size()].get());
      GST_BUFFER_PTS(buffer) = gst_util_uint64_scale(static_cast<guint64>(i), GST_SECOND, 30);
      GST_BUFFER_OFFSET(buffer) = static_cast<guint64>(i);
      if (gst_app_src_push_buffer(in, buffer) != GST_FLOW_OK)
        break; // the bus says why
    }
    gst_app_src_end_of_stream(in);
  }

  /// In front of every other scene a stream begins, with the id of one of four.
  static GstPadProbeReturn begin_streams(GstPad* pad, GstPadProbeInfo* info, gpointer) {
    const guint64 frame = GST_BUFFER_OFFSET(GST_PAD_PROBE_INFO_BUFFER(info));
    if (frame == 0 || frame % (2 * frames_of_a_scene) != 0)
      return GST_PAD_PROBE_OK;
    static std::atomic<unsigned> next = 0;
    gst_pad_push_event(pad, gst_event_new_stream_start(("camera-" + std::to_string(next++ % 4)).c_str()));
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_pad_push_event(pad, gst_event_new_segment(&segment));
    return GST_PAD_PROBE_OK;
  }

  void leak() {
    if (leak_ == "memory")
      leaked_ = std::memset(std::malloc(2 << 20), 1, 2 << 20);
    else if (leak_ == "descriptors")
      (void)!dup(1);
    else if (leak_ == "threads")
      std::thread([] { pause(); }).detach();
  }

  void* volatile leaked_ = nullptr; // or the compiler leaves the leak out
  const Seconds length_;
  const std::string leak_;
  Watchdog watchdog_{std::chrono::seconds(90)};
  std::vector<Frames> frames_;
  std::array<Stopwatch, 10> tenths_;
  std::mt19937 random_{1};
  std::uint64_t frames_through_ = 0;
};

/// What part of the rounds, in tenths, holds at least. What an allocator keeps, or a thread that a busy
/// machine has not let end yet, comes on top of it; what leaks raises the least, too.
struct Part {
  double used_mib = 1e9, rss_mib = 1e9;
  long descriptors = std::numeric_limits<long>::max(), threads = std::numeric_limits<long>::max();
  Stopwatch time;

  Part(const std::vector<Round>& rounds, const std::array<Stopwatch, 10>& tenths, std::size_t from,
       std::size_t to) {
    for (std::size_t i = rounds.size() * from / 10; i < rounds.size() * to / 10; ++i) {
      used_mib = std::min(used_mib, rounds[i].used_mib);
      rss_mib = std::min(rss_mib, rounds[i].rss_mib);
      descriptors = std::min(descriptors, rounds[i].descriptors);
      threads = std::min(threads, rounds[i].threads);
    }
    for (std::size_t i = from; i < to; ++i)
      time.add(tenths[i]);
  }
};

/// Whether nothing has grown from the third and fourth tenth of the rounds to the last two.
bool judge(const std::vector<Round>& rounds, const std::array<Stopwatch, 10>& tenths) {
  const Part early(rounds, tenths, 2, 4), late(rounds, tenths, 8, 10);
  bool good = true;
  const auto row = [&good](const char* what, double before, double after, double most) {
    const bool ok = after <= most;
    std::printf("%s %-28s %8.2f -> %8.2f (at most %.2f)\n", ok ? "ok  " : "FAIL", what, before, after, most);
    good = good && ok;
  };
  row("memory in use, MiB", early.used_mib, late.used_mib, early.used_mib + 1);
  row("resident memory, MiB", early.rss_mib, late.rss_mib, early.rss_mib + 4);
  row("descriptors", static_cast<double>(early.descriptors), static_cast<double>(late.descriptors),
      static_cast<double>(early.descriptors));
  row("threads", static_cast<double>(early.threads), static_cast<double>(late.threads),
      static_cast<double>(early.threads));
  // The processor's time, for on a shared machine the wall's says more about the neighbours.
  row("p99.9 of a frame, ms of CPU", early.time.processor.p999(), late.time.processor.p999(),
      3 * early.time.processor.p999());
  std::printf("     p99.9 of a frame on the wall %.2f -> %.2f ms\n", early.time.wall.p999(),
              late.time.wall.p999());
  return good;
}

int soak(int argc, char** argv) {
  // Pipelines come and go with their threads, and each thread begins in one of up to eight arenas a
  // processor: which pages of them stay in use wanders by some MiB. With two arenas what is left is growth.
  mallopt(M_ARENA_MAX, 2);
  gst_init(&argc, &argv);
  g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_FATAL_MASK | G_LOG_LEVEL_CRITICAL));
  if (argc < 2 || std::atof(argv[1]) <= 0) {
    std::fprintf(stderr, "usage: soak SECONDS [CSV [memory|descriptors|threads|latency]]\n");
    return 2;
  }
  std::FILE* csv = argc > 2 && *argv[2] ? std::fopen(argv[2], "w") : nullptr;
  if (argc > 2 && *argv[2] && !csv)
    give_up(std::string("cannot write ") + argv[2]);
  Soak soak(Seconds(std::atof(argv[1])), argc > 3 ? argv[3] : "");
  const std::vector<Round> rounds = soak.run(csv);
  if (csv)
    std::fclose(csv);
  std::printf("%llu frames in %.0f s, %zu rounds; no frame lost, no error, no critical\n",
              static_cast<unsigned long long>(rounds.back().frames), rounds.back().seconds, rounds.size());
  return judge(rounds, soak.tenths()) ? 0 : 1;
}

} // namespace
} // namespace terrainseg::test

int main(int argc, char** argv) {
  return terrainseg::test::soak(argc, argv);
}
