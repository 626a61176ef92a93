// SPDX-License-Identifier: LGPL-2.1-or-later
// Does for a while what applications do to the elements, in an order that a seed decides: properties set from
// two threads, seeks, caps changes, relinking by pad probes, state changes, saving, loading and resetting,
// splitmuxsink, decodebin3, playbin with a video-filter, a link's two ends. An error, a critical and a step
// that does not end within its time fail it.
//
//   stress SECONDS [SEED [PART]]         one more argument: that part alone
//
// TERRAINSEG_PATIENCE multiplies the time that a step may take (a build with a sanitizer).
#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <functional>
#include <random>

#include "program.hpp"

namespace terrainseg::test {
namespace {

using std::chrono::milliseconds;
using Random = std::mt19937;

int below(Random& random, int limit) {
  return static_cast<int>(random() % static_cast<unsigned>(limit));
}
template <class List> auto one_of(Random& random, const List& list) {
  return list[random() % list.size()];
}

const std::array<std::string, 6> formats = {"I420", "NV12", "YUY2", "RGB", "BGRx", "Y444"};
const std::array<std::string, 4> sizes = {"width=160,height=120", "width=97,height=65",
                                          "width=320,height=180", "width=33,height=200"};

struct Stress {
  std::filesystem::path folder;
  Watchdog* watchdog = nullptr;
  milliseconds patience{20000};
  unsigned long warnings = 0;
  unsigned long lost_by_bin = 0; ///< states

  std::string file(const char* name) const { return (folder / name).string(); }
  void step(const char* name) const { watchdog->step(name); }

  /// An error on the bus gives up; warnings are counted.
  void look_at(const Pipeline& pipeline) {
    while (Owned<GstMessage> message{gst_bus_pop_filtered(
        pipeline.bus(), static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING))}) {
      if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR)
        give_up("an error that should not be: " + Pipeline::text_of(message.get()));
      ++warnings;
    }
  }
  /// Waits until the state that was asked for is there.
  void reach(const Pipeline& pipeline) const {
    if (!reach_or_lose(pipeline, patience))
      give_up("a state is not reached: " + states_of(pipeline));
  }
  /// The same where the pipeline was told another state while it was on its way to one. There GstBin itself
  /// may wait for ever (seen with 1.22: videotestsrc ! fakesink, PLAYING, PAUSED 0 to 3 ms later): its thread
  /// that goes on to PLAYING sees that this is not wanted any more, and nobody completes PAUSED. Its elements
  /// have all arrived, and nothing but READY or NULL gets it out; an element that has not arrived still
  /// fails.
  void reach_interrupted(const Pipeline& pipeline) {
    const auto end = std::chrono::steady_clock::now() + patience;
    for (int settled = 0; !reach_or_lose(pipeline, milliseconds(100));) {
      settled = elements_arrived(pipeline) ? settled + 1 : 0;
      if (settled == 10) {
        ++lost_by_bin;
        gst_element_set_state(pipeline.get(), GST_STATE_READY);
        return reach(pipeline);
      }
      if (std::chrono::steady_clock::now() > end)
        give_up("a state is not reached: " + states_of(pipeline));
    }
  }

 private:
  /// False: not in that time.
  bool reach_or_lose(const Pipeline& pipeline, milliseconds time) const {
    step("waiting for a state");
    const GstStateChangeReturn result = gst_element_get_state(
        pipeline.get(), nullptr, nullptr, static_cast<GstClockTime>(time.count()) * GST_MSECOND);
    if (result == GST_STATE_CHANGE_FAILURE)
      give_up("a state is refused: " + states_of(pipeline));
    return result != GST_STATE_CHANGE_ASYNC;
  }
  /// Whether every element is in the state that the bin is on its way to, and on no way itself.
  static bool elements_arrived(const Pipeline& pipeline) {
    bool all = true;
    pipeline.each_element([&](GstElement* element) {
      all = all && GST_STATE(element) == GST_STATE_NEXT(pipeline.get()) &&
            GST_STATE_PENDING(element) == GST_STATE_VOID_PENDING;
    });
    return all;
  }
  static std::string states_of(const Pipeline& pipeline) {
    std::string text;
    const auto add = [&](GstElement* element) {
      text.append(text.empty() ? "" : ", ").append(GST_ELEMENT_NAME(element)).append(" ");
      text.append(gst_element_state_get_name(GST_STATE(element)));
      if (GST_STATE_PENDING(element) != GST_STATE_VOID_PENDING)
        text.append(" to ").append(gst_element_state_get_name(GST_STATE_PENDING(element)));
    };
    add(pipeline.get());
    pipeline.each_element(add);
    return text;
  }
};

// ---- properties ------------------------------------------------------------------------------------------

/// Sets a property to something that its type allows; those that name files are left alone.
void set_at_random(GstElement* element, GParamSpec* spec, Random& random) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, spec->value_type);
  const auto share = static_cast<double>(random() % 1001) / 1000;
  if (G_IS_PARAM_SPEC_BOOLEAN(spec)) {
    g_value_set_boolean(&value, below(random, 2));
  } else if (G_IS_PARAM_SPEC_INT(spec)) {
    const auto* range = G_PARAM_SPEC_INT(spec);
    g_value_set_int(&value, static_cast<int>(range->minimum + share * (range->maximum - range->minimum)));
  } else if (G_IS_PARAM_SPEC_UINT(spec)) {
    const auto* range = G_PARAM_SPEC_UINT(spec);
    g_value_set_uint(&value, static_cast<guint>(range->minimum + share * (range->maximum - range->minimum)));
  } else if (G_IS_PARAM_SPEC_DOUBLE(spec)) {
    const auto* range = G_PARAM_SPEC_DOUBLE(spec);
    g_value_set_double(&value, range->minimum + share * (range->maximum - range->minimum));
  } else if (G_IS_PARAM_SPEC_ENUM(spec)) {
    const GEnumClass* names = G_PARAM_SPEC_ENUM(spec)->enum_class;
    g_value_set_enum(&value, names->values[random() % names->n_values].value);
  } else if (G_IS_PARAM_SPEC_FLAGS(spec)) {
    g_value_set_flags(&value, random() & G_PARAM_SPEC_FLAGS(spec)->flags_class->mask);
  } else {
    g_value_unset(&value);
    return;
  }
  g_object_set_property(G_OBJECT(element), spec->name, &value);
  g_value_unset(&value);
}

/// Everything that may be set while playing, once in random order.
void set_some(GstElement* element, Random& random) {
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element), &count);
  for (int i = 0; i < 4; ++i) {
    GParamSpec* spec = specs[random() % count];
    const bool is_ours = g_type_is_a(spec->owner_type, GST_TYPE_ELEMENT) && std::strcmp(spec->name, "name") &&
                         std::strcmp(spec->name, "parent") && std::strcmp(spec->name, "qos");
    if (is_ours && (spec->flags & G_PARAM_WRITABLE) &&
        (spec->flags & (GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE)))
      set_at_random(element, spec, random);
  }
  g_free(specs);
}

/// What else an application does to a terrainseg that runs.
void ask_something(Stress& s, GstElement* f, Random& random, const char* model) {
  GstStructure* stats = nullptr;
  gboolean done = FALSE;
  static constexpr std::array rectangles = {"0.35,0.85,0.3,0.15", "0,0,1,1", ""};
  static constexpr std::array regions = {"<>", "<<0,0,40,20>>", "<<5,90,9000,40>,<10,10,1,1>>"};
  switch (below(random, 8)) {
  case 0:
    g_signal_emit_by_name(f, "reset");
    break;
  case 1:
    g_signal_emit_by_name(f, "save-model", s.file(model).c_str(), &done);
    break;
  case 2:
    if (std::filesystem::exists(s.file(model)))
      g_signal_emit_by_name(f, "load-model", s.file(model).c_str(), &done);
    break;
  case 3:
    g_signal_emit_by_name(f, "unset-property", nullptr, &done);
    break;
  case 4:
    g_object_set(f, "window-rect", one_of(random, rectangles), nullptr);
    break;
  case 5:
    gst_util_set_object_arg(G_OBJECT(f), "ignore-regions", one_of(random, regions));
    break;
  case 6:
    g_object_set(f, "instance", below(random, 2) ? "front" : nullptr, nullptr);
    break;
  default:
    g_object_get(f, "stats", &stats, nullptr);
    if (!stats)
      give_up("no stats");
    gst_structure_free(stats);
  }
}

void properties(Stress& s, Random& random) {
  const Pipeline pipeline("terrainscenesrc name=src ! video/x-raw,format=" + one_of(random, formats) + "," +
                          one_of(random, sizes) + " ! terrainseg name=f ! queue ! terrainoverlay name=o ! " +
                          "terrainextract name=e ! meta/x-klv,parsed=true ! fakesink");
  pipeline.play();
  s.reach(pipeline);
  std::atomic<bool> stop = false;
  const auto work = [&](unsigned seed, const char* model) {
    Random own(seed);
    while (!stop) {
      s.step("setting properties");
      set_some(pipeline.find(own() % 2 ? "f" : "o"), own);
      if (own() % 4 == 0)
        set_some(pipeline.find(own() % 2 ? "e" : "src"), own);
      if (own() % 4 == 0)
        ask_something(s, pipeline.find("f"), own, model);
      std::this_thread::sleep_for(std::chrono::microseconds(own() % 2000));
    }
  };
  // One file of both: what is written while it is read must be whole.
  std::thread one(work, random(), "both.terrain"), other(work, random(), "both.terrain");
  std::this_thread::sleep_for(milliseconds(1500));
  stop = true;
  one.join();
  other.join();
  s.look_at(pipeline);
}

// ---- seeks and states ------------------------------------------------------------------------------------

/// A seek to somewhere; reverse, segment and trick ones among them.
void seek(Stress& s, const Pipeline& pipeline, Random& random) {
  const GstClockTime end = 3 * GST_SECOND; // of the recording
  const GstClockTime a = random() % end, b = a + random() % (end - a) + GST_SECOND / 30;
  int flags = GST_SEEK_FLAG_FLUSH;
  double rate = 1;
  switch (below(random, 5)) {
  case 0:
    flags |= GST_SEEK_FLAG_ACCURATE;
    break;
  case 1:
    flags |= GST_SEEK_FLAG_SEGMENT;
    break;
  case 2:
    rate = -1;
    break;
  case 3:
    flags |= GST_SEEK_FLAG_TRICKMODE | GST_SEEK_FLAG_TRICKMODE_KEY_UNITS;
    rate = 4;
    break;
  default:
    flags |= GST_SEEK_FLAG_KEY_UNIT;
  }
  s.step("seeking");
  gst_element_seek(pipeline.get(), rate, GST_FORMAT_TIME, static_cast<GstSeekFlags>(flags), GST_SEEK_TYPE_SET,
                   static_cast<gint64>(a), GST_SEEK_TYPE_SET, static_cast<gint64>(std::min(b, end)));
  s.reach(pipeline);
}

void seek_for_a_while(Stress& s, const Pipeline& pipeline, Random& random, int times) {
  for (int i = 0; i < times; ++i) {
    seek(s, pipeline, random);
    std::this_thread::sleep_for(milliseconds(random() % 80));
    s.look_at(pipeline);
  }
}

void seeks(Stress& s, Random& random) {
  const Pipeline pipeline("filesrc location=" + s.file("drive.mp4") +
                          " ! qtdemux ! h264parse ! avdec_h264 max-threads=1 ! terrainseg ! terrainoverlay ! "
                          "terrainextract ! application/x-ndjson ! fakesink");
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  s.reach(pipeline);
  pipeline.play();
  seek_for_a_while(s, pipeline, random, 15);
}

void seeks_of_a_link(Stress& s, Random& random) {
  const Pipeline pipeline(
      "filesrc location=" + s.file("drive.ts") +
      " ! tsdemux name=d d. ! queue ! h264parse ! avdec_h264 max-threads=1 ! c.sink "
      "d. ! queue ! meta/x-klv ! c.meta terraincombine name=c ! terrainoverlay ! fakesink");
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  s.reach(pipeline);
  pipeline.play();
  for (int i = 0; i < 10; ++i) {
    GstStructure* stats = nullptr;
    s.step("seeking a transport stream");
    gst_element_seek_simple(pipeline.get(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                            static_cast<gint64>(random() % (2 * GST_SECOND)));
    s.reach(pipeline);
    g_object_set(pipeline.find("c"), "latency", random() % 500, nullptr);
    g_object_get(pipeline.find("c"), "stats", &stats, nullptr);
    gst_structure_free(stats);
    std::this_thread::sleep_for(milliseconds(random() % 80));
    s.look_at(pipeline);
  }
}

void states(Stress& s, Random& random) {
  static constexpr std::array all = {GST_STATE_NULL, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_PLAYING};
  const Pipeline pipeline("terrainscenesrc ! video/x-raw," + one_of(random, sizes) +
                          " ! terrainseg name=f ! tee name=t t. ! queue ! c.sink "
                          "t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! c.meta "
                          "terraincombine name=c ! terrainoverlay ! fakesink");
  for (int i = 0; i < 30; ++i) {
    s.step("changing the state");
    const GstState wanted = one_of(random, all);
    if (gst_element_set_state(pipeline.get(), wanted) == GST_STATE_CHANGE_FAILURE) {
      s.look_at(pipeline);
      give_up(std::string("no message tells why this state is refused: ") +
              gst_element_state_get_name(wanted));
    }
    if (below(random, 3) == 0)
      s.reach_interrupted(pipeline);
    ask_something(s, pipeline.find("f"), random, "states.terrain");
    std::this_thread::sleep_for(milliseconds(random() % 30));
    s.look_at(pipeline);
  }
}

// ---- pipelines that change while they run ----------------------------------------------------------------

void caps(Stress& s, Random& random) {
  // delayed: otherwise a frame that is under way while the filter changes is refused by it (also
  // videotestsrc's).
  const Pipeline pipeline("terrainscenesrc ! capsfilter name=caps caps-change-mode=delayed "
                          "caps=video/x-raw,format=I420 ! terrainseg ! "
                          "queue ! terrainoverlay ! terrainextract ! application/x-ndjson ! fakesink");
  pipeline.play();
  s.reach(pipeline);
  for (int i = 0; i < 25; ++i) {
    s.step("changing the caps");
    const Owned<GstCaps> wanted(gst_caps_from_string(
        ("video/x-raw,format=" + one_of(random, formats) + "," + one_of(random, sizes)).c_str()));
    g_object_set(pipeline.find("caps"), "caps", wanted.get(), nullptr);
    std::this_thread::sleep_for(milliseconds(random() % 60));
    s.look_at(pipeline);
  }
}

/// What the blocked pad's probe needs.
struct Swap {
  GstElement* bin;
  GstElement *before, *after;
  const char* factory;
  std::atomic<bool> done = false;
};

/// Replaces the element between `before` and `after` while nothing flows.
GstPadProbeReturn swap_elements(GstPad* pad, GstPadProbeInfo*, gpointer data) {
  auto* swap = static_cast<Swap*>(data);
  GstElement* old = nullptr;
  if (GstPad* peer = gst_pad_get_peer(pad)) {
    old = gst_pad_get_parent_element(peer);
    gst_object_unref(peer);
  }
  gst_element_unlink_many(swap->before, old, swap->after, nullptr);
  gst_element_set_state(old, GST_STATE_NULL);
  gst_bin_remove(GST_BIN(swap->bin), old);
  gst_object_unref(old);
  GstElement* fresh = gst_element_factory_make(swap->factory, nullptr);
  gst_bin_add(GST_BIN(swap->bin), fresh);
  if (!gst_element_link_many(swap->before, fresh, swap->after, nullptr) ||
      !gst_element_sync_state_with_parent(fresh))
    give_up("relinking fails");
  swap->done = true;
  return GST_PAD_PROBE_REMOVE;
}

void relinking(Stress& s, Random& random) {
  static constexpr std::array factories = {"terrainseg", "terrainoverlay", "identity", "terrainseg"};
  const Pipeline pipeline("terrainscenesrc ! video/x-raw,format=I420," + one_of(random, sizes) +
                          " ! queue name=before ! terrainseg ! queue name=after ! terrainoverlay ! fakesink");
  pipeline.play();
  s.reach(pipeline);
  for (int i = 0; i < 20; ++i) {
    s.step("relinking");
    Swap swap{pipeline.get(), pipeline.find("before"), pipeline.find("after"), one_of(random, factories)};
    gst_pad_add_probe(pipeline.pad("before", "src").get(), GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM, swap_elements,
                      &swap, nullptr);
    while (!swap.done)
      std::this_thread::sleep_for(milliseconds(1)); // the watchdog ends it
    std::this_thread::sleep_for(milliseconds(random() % 20));
    s.look_at(pipeline);
  }
}

/// The sink of a link comes and goes behind a tee that allows it.
void link_and_unlink(Stress& s, Random& random) {
  const Pipeline pipeline(
      "terrainscenesrc ! video/x-raw,format=I420,width=97,height=65 ! terrainseg ! tee name=t "
      "t. ! queue ! c.sink t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! c.meta "
      "terraincombine name=c ! tee name=out allow-not-linked=true out. ! queue ! fakesink sync=false");
  pipeline.play();
  s.reach(pipeline);
  GstElement* out = pipeline.find("out");
  for (int i = 0; i < 10; ++i) {
    s.step("a branch comes and goes");
    GstElement *queue = gst_element_factory_make("queue", nullptr),
               *sink = gst_element_factory_make("fakesink", nullptr);
    g_object_set(sink, "async", FALSE, nullptr);
    gst_bin_add_many(GST_BIN(pipeline.get()), queue, sink, nullptr);
    gst_element_link(queue, sink);
    gst_element_sync_state_with_parent(sink);
    gst_element_sync_state_with_parent(queue);
    GstPad* pad = gst_element_request_pad_simple(out, "src_%u");
    const Owned<GstPad> entry(gst_element_get_static_pad(queue, "sink"));
    gst_pad_link(pad, entry.get());
    std::this_thread::sleep_for(milliseconds(random() % 60));
    gst_element_release_request_pad(out, pad);
    gst_object_unref(pad);
    for (GstElement* element : {queue, sink}) {
      gst_element_set_state(element, GST_STATE_NULL);
      gst_bin_remove(GST_BIN(pipeline.get()), element);
    }
    s.look_at(pipeline);
  }
}

// ---- bins that applications build on ---------------------------------------------------------------------

void splitting(Stress& s, Random& random) {
  const Pipeline pipeline(
      "terrainscenesrc num-buffers=" + std::to_string(30 + random() % 60) +
      " ! video/x-raw,format=I420,width=160,height=120 ! terrainseg overlay=true ! queue ! x264enc "
      "tune=zerolatency speed-preset=ultrafast threads=1 key-int-max=10 ! h264parse ! splitmuxsink "
      "max-size-time=500000000 location=" +
      s.file("split%03d.mp4"));
  s.step("splitmuxsink");
  pipeline.play();
  if (!pipeline.wait(s.patience))
    give_up("splitmuxsink does not come to its end");
  s.look_at(pipeline);
}

void decodebin3(Stress& s, Random& random) {
  const Pipeline pipeline(
      "filesrc location=" + s.file("drive.mp4") +
      " ! decodebin3 ! videoconvert ! terrainseg ! terrainextract ! meta/x-klv,parsed=true ! fakesink");
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  s.reach(pipeline);
  pipeline.play();
  seek_for_a_while(s, pipeline, random, 4);
}

void playbin(Stress& s, Random& random) {
  GstElement* bin = gst_element_factory_make("playbin", nullptr);
  const Pipeline pipeline(bin);
  gchar* uri = gst_filename_to_uri(s.file("drive.mp4").c_str(), nullptr);
  g_object_set(bin, "uri", uri, "video-filter", gst_element_factory_make("terrainseg", nullptr), "video-sink",
               gst_element_factory_make("fakesink", nullptr), nullptr);
  g_free(uri);
  for (int i = 0; i < 2; ++i) {
    gst_element_set_state(bin, GST_STATE_PAUSED);
    s.reach(pipeline);
    pipeline.play();
    seek_for_a_while(s, pipeline, random, 4);
    gst_element_set_state(bin, GST_STATE_READY);
  }
}

// ---- the program -----------------------------------------------------------------------------------------

struct Part {
  const char* name;
  void (*run)(Stress&, Random&);
};
constexpr std::array parts = {Part{"properties", properties},
                              Part{"seeks", seeks},
                              Part{"link-seeks", seeks_of_a_link},
                              Part{"states", states},
                              Part{"caps", caps},
                              Part{"relinking", relinking},
                              Part{"branches", link_and_unlink},
                              Part{"splitmuxsink", splitting},
                              Part{"decodebin3", decodebin3},
                              Part{"playbin", playbin}};

/// Three seconds of a drive: as a film, and as a transport stream with units.
void record(Stress& s) {
  for (const char* tail :
       {"x264enc tune=zerolatency speed-preset=ultrafast threads=1 key-int-max=10 ! h264parse ! mp4mux ! "
        "filesink "
        "location=drive.mp4",
        "terrainseg ! tee name=t t. ! queue ! x264enc tune=zerolatency speed-preset=ultrafast threads=1 "
        "key-int-max=10 ! h264parse ! queue ! mux. t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! "
        "queue ! mux. "
        "mpegtsmux name=mux alignment=7 ! filesink location=drive.ts"}) {
    std::string text(tail);
    text.insert(text.rfind("location=") + 9, s.folder.string() + "/");
    const Pipeline pipeline(
        "terrainscenesrc num-buffers=90 ! video/x-raw,format=I420,width=160,height=120 ! " + text);
    s.step("recording");
    pipeline.play();
    if (!pipeline.wait(s.patience))
      give_up("recording does not come to its end");
  }
}

int stress(int argc, char** argv) {
  gst_init(&argc, &argv);
  g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_FATAL_MASK | G_LOG_LEVEL_CRITICAL));
  if (argc < 2 || std::atoi(argv[1]) <= 0) {
    std::fprintf(stderr, "usage: stress SECONDS [SEED [PART]]\n");
    return 2;
  }
  const auto seed = static_cast<unsigned>(argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 1);
  const char* only = argc > 3 ? argv[3] : nullptr;
  const char* patience = std::getenv("TERRAINSEG_PATIENCE");
  gchar* folder = g_dir_make_tmp("terrainseg-stress-XXXXXX", nullptr);
  Stress s;
  s.folder = folder;
  g_free(folder);
  s.patience *= patience ? std::max(1, std::atoi(patience)) : 1;
  int ran = 0;
  {
    Watchdog watchdog(std::chrono::duration_cast<std::chrono::seconds>(s.patience) + std::chrono::seconds(5));
    s.watchdog = &watchdog;
    record(s);
    Random random(seed);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::atoi(argv[1]));
    std::vector<Part> order(parts.begin(), parts.end());
    std::erase_if(order, [&](const Part& part) { return only && std::strcmp(part.name, only) != 0; });
    if (order.empty())
      give_up(std::string("no part is called ") + only);
    for (bool first = true; first || std::chrono::steady_clock::now() < end; first = false) {
      std::shuffle(order.begin(), order.end(), random);
      for (const Part& part : order) {
        std::printf("%s\n", part.name);
        std::fflush(stdout);
        part.run(s, random);
        ++ran;
      }
    }
  }
  std::filesystem::remove_all(s.folder);
  std::printf("ok: seed %u, %d parts, %lu warnings, %lu states lost by GstBin\n", seed, ran, s.warnings,
              s.lost_by_bin);
  gst_deinit();
  return 0;
}

} // namespace
} // namespace terrainseg::test

int main(int argc, char** argv) {
  return terrainseg::test::stress(argc, argv);
}
