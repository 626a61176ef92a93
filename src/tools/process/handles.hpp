// SPDX-License-Identifier: LGPL-2.1-or-later
// RAII owners for C handles.
#pragma once

#include <gst/gst.h>

#include <memory>
#include <string>

namespace terrainseg::process {

template <auto release> struct Releaser {
  template <typename T> void operator()(T* pointer) const { release(pointer); }
};

using CharPointer = std::unique_ptr<char, Releaser<g_free>>;
using ElementPointer = std::unique_ptr<GstElement, Releaser<gst_object_unref>>;
using FactoryPointer = std::unique_ptr<GstElementFactory, Releaser<gst_object_unref>>;
using PadPointer = std::unique_ptr<GstPad, Releaser<gst_object_unref>>;
using BusPointer = std::unique_ptr<GstBus, Releaser<gst_object_unref>>;
using CapsPointer = std::unique_ptr<GstCaps, Releaser<gst_caps_unref>>;
using MessagePointer = std::unique_ptr<GstMessage, Releaser<gst_message_unref>>;
using ErrorPointer = std::unique_ptr<GError, Releaser<g_error_free>>;

/// Copies and frees a string that a C function returned; nothing for null.
inline std::string take(char* text) {
  const CharPointer owner(text);
  return text ? text : "";
}

/// A number with a decimal point in every locale.
inline std::string number_text(const char* format, double value) {
  char text[G_ASCII_DTOSTR_BUF_SIZE];
  return g_ascii_formatd(text, sizeof text, format, value);
}

/// The caps in an event, which keeps them.
inline GstCaps* caps_of(GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  return caps;
}

/// The media type of caps; empty without caps.
inline std::string media_type(const GstCaps* caps) {
  return caps ? gst_structure_get_name(gst_caps_get_structure(caps, 0)) : "";
}

inline PadPointer pad_of(GstElement* element, const char* name) {
  return PadPointer(gst_element_get_static_pad(element, name));
}

/// Adds a probe of these types that calls a method of `owner`.
template <auto method, typename Owner> void add_probe(const PadPointer& pad, int types, Owner* owner) {
  const auto call = [](GstPad* at, GstPadProbeInfo* info, gpointer self) {
    return (static_cast<Owner*>(self)->*method)(at, info);
  };
  gst_pad_add_probe(pad.get(), static_cast<GstPadProbeType>(types), call, owner, nullptr);
}

/// What an error or a warning says; `debug`, where it is asked for, must be freed.
inline ErrorPointer error_in(GstMessage* message, gchar** debug = nullptr) {
  GError* error = nullptr;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING)
    gst_message_parse_warning(message, &error, debug);
  else
    gst_message_parse_error(message, &error, debug);
  return ErrorPointer(error);
}

} // namespace terrainseg::process
