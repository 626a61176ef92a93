// SPDX-License-Identifier: LGPL-2.1-or-later
// GStreamer's objects in the hands of a test: they go when it ends, however it ends.
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>

#include <memory>

namespace terrainseg::test {

struct Unref {
  void operator()(GstBuffer* p) const { gst_buffer_unref(p); }
  void operator()(GstBus* p) const { gst_object_unref(p); }
  void operator()(GstClock* p) const { gst_object_unref(p); }
  void operator()(GstCaps* p) const { gst_caps_unref(p); }
  void operator()(GstElement* p) const {
    gst_element_set_state(p, GST_STATE_NULL);
    gst_object_unref(p);
  }
  void operator()(GstEvent* p) const { gst_event_unref(p); }
  void operator()(GstHarness* p) const { gst_harness_teardown(p); }
  void operator()(GstMessage* p) const { gst_message_unref(p); }
  void operator()(GstPad* p) const { gst_object_unref(p); }
  void operator()(GstSample* p) const { gst_sample_unref(p); }
};
template <class T> using Owned = std::unique_ptr<T, Unref>;

} // namespace terrainseg::test
