// SPDX-License-Identifier: LGPL-2.1-or-later
// What the long-running programs share: a pipeline with its end, frames of rendered scenes, a watchdog.
#pragma once

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "../element/owned.hpp"

namespace terrainseg::test {

/// Says what went wrong and ends the program.
[[noreturn]] inline void give_up(const std::string& what) {
  std::fprintf(stderr, "FAIL %s\n", what.c_str());
  std::fflush(nullptr);
  std::_Exit(1);
}

/// Gives up when nobody said for so long that something went on. What hangs is the step that was named last.
class Watchdog {
 public:
  explicit Watchdog(std::chrono::seconds limit) : limit_(limit), thread_([this] { watch(); }) {}
  ~Watchdog() {
    done_ = true;
    thread_.join();
  }
  void step(const char* name) {
    name_ = name;
    ++steps_;
  }

 private:
  void watch() {
    unsigned seen = 0;
    auto since = std::chrono::steady_clock::now();
    while (!done_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      const auto now = std::chrono::steady_clock::now();
      if (seen != steps_) {
        seen = steps_;
        since = now;
      } else if (now - since > limit_) {
        give_up(std::string("hangs in: ") + name_.load());
      }
    }
  }

  const std::chrono::seconds limit_;
  std::atomic<const char*> name_{"start"}; // of a string that lives as long as the program
  std::atomic<unsigned> steps_{0};
  std::atomic<bool> done_{false};
  std::thread thread_;
};

/// A pipeline that is stopped when it goes.
class Pipeline {
 public:
  explicit Pipeline(const std::string& text) : text_(text) {
    GError* error = nullptr;
    GstElement* element = gst_parse_launch(text.c_str(), &error);
    if (error || !element)
      give_up(text + ": " + (error ? error->message : "no pipeline"));
    element_.reset(GST_ELEMENT(gst_object_ref_sink(element)));
    bus_.reset(gst_element_get_bus(element));
  }
  explicit Pipeline(GstElement* element) : text_(GST_OBJECT_NAME(element)) {
    element_.reset(GST_ELEMENT(gst_object_ref_sink(element)));
    bus_.reset(gst_element_get_bus(element));
  }
  ~Pipeline() { gst_element_set_state(element_.get(), GST_STATE_NULL); }
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  GstElement* get() const { return element_.get(); }
  GstBus* bus() const { return bus_.get(); }
  /// Lives as long as the pipeline.
  GstElement* find(const char* name) const {
    GstElement* element = gst_bin_get_by_name(GST_BIN(element_.get()), name);
    gst_object_unref(element);
    return element;
  }
  /// Those of its own level.
  template <class Use> void each_element(Use use) const {
    GstIterator* iterator = gst_bin_iterate_elements(GST_BIN(element_.get()));
    GValue item = G_VALUE_INIT;
    while (gst_iterator_next(iterator, &item) == GST_ITERATOR_OK) {
      use(GST_ELEMENT(g_value_get_object(&item)));
      g_value_reset(&item);
    }
    g_value_unset(&item);
    gst_iterator_free(iterator);
  }
  Owned<GstPad> pad(const char* element, const char* name) const {
    return Owned<GstPad>(gst_element_get_static_pad(find(element), name));
  }

  void play() const {
    if (gst_element_set_state(element_.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
      give_up(text_ + " does not start: " + error());
  }
  /// Waits for the end of the stream at most so long; an error gives up.
  bool wait(std::chrono::milliseconds time) const {
    Owned<GstMessage> message(
        gst_bus_timed_pop_filtered(bus_.get(), static_cast<GstClockTime>(time.count()) * GST_MSECOND,
                                   static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
    if (message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR)
      give_up(text_ + ": " + text_of(message.get()));
    return message != nullptr;
  }
  static std::string text_of(GstMessage* message) {
    GError* error = nullptr;
    gchar* debug = nullptr;
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
      gst_message_parse_error(message, &error, &debug);
    else
      gst_message_parse_warning(message, &error, &debug);
    const std::string text = std::string(GST_MESSAGE_SRC_NAME(message)) + ": " + error->message + " (" +
                             (debug ? debug : "") + ")";
    g_clear_error(&error);
    g_free(debug);
    return text;
  }

 private:
  std::string error() const {
    Owned<GstMessage> message(gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_ERROR));
    return message ? text_of(message.get()) : "no message";
  }

  std::string text_;
  Owned<GstElement> element_;
  Owned<GstBus> bus_;
};

/// Counts the buffers on a pad.
inline void count_buffers(GstPad* pad, std::atomic<std::uint64_t>& count) {
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer counter) {
        ++*static_cast<std::atomic<std::uint64_t>*>(counter);
        return GST_PAD_PROBE_OK;
      },
      &count, nullptr);
}

/// Rendered frames, with the caps that they have.
struct Frames {
  std::vector<Owned<GstBuffer>> buffers;
  std::string caps;
};

inline Frames render(const std::string& properties, const std::string& caps, int count) {
  Frames frames;
  frames.caps = caps;
  const Pipeline pipeline("terrainscenesrc " + properties + " num-buffers=" + std::to_string(count) + " ! " +
                          caps + " ! appsink name=out sync=false");
  pipeline.play();
  GstAppSink* out = GST_APP_SINK(pipeline.find("out"));
  while (Owned<GstSample> sample{gst_app_sink_pull_sample(out)})
    frames.buffers.emplace_back(gst_buffer_copy_deep(gst_sample_get_buffer(sample.get()))); // the pool may go
  if (frames.buffers.size() != static_cast<std::size_t>(count))
    give_up("rendering " + caps + " gave " + std::to_string(frames.buffers.size()) + " frames");
  return frames;
}

} // namespace terrainseg::test
