// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/complaints.hpp"

#include <gst/pbutils/missing-plugins.h>

#include <algorithm>

#include "tools/process/handles.hpp"

namespace terrainseg::process {

void Complaints::take_all(GstBus* bus, GstClockTime timeout) {
  constexpr auto wanted =
      static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING | GST_MESSAGE_ELEMENT);
  while (const MessagePointer message{gst_bus_timed_pop_filtered(bus, timeout, wanted)}) {
    take(message.get());
    timeout = 0;
  }
}

void Complaints::take(GstMessage* message) {
  switch (GST_MESSAGE_TYPE(message)) {
  case GST_MESSAGE_ERROR:
    take_error(message);
    break;
  case GST_MESSAGE_WARNING:
    warn(message);
    break;
  default:
    if (gst_is_missing_plugin_message(message) && missing_decoder_.empty())
      missing_decoder_ = no_decoder(message);
  }
}

/// An element without a parent belongs to the source: uridecodebin removes elements while it stops.
void Complaints::take_error(GstMessage* message) {
  if (graph_.holds(message->src)) {
    if (behind_)
      return;
    const auto output = graph_.output_of(message->src);
    behind_ = {cause_behind_source(message, output.has_value()), text_of(message)};
    if (output && (behind_.cause == Cause::disk || behind_.cause == Cause::unwritable))
      behind_.text = "cannot write " + files_[*output].final_path().string() + ": " + behind_.text;
    return;
  }
  if (source_fault_)
    return;
  gave_up_ = says_nothing(message);
  source_fault_ = {cause_in_source(message), gave_up_ ? giving_up(message) : text_of(message)};
  if (gave_up_ && source_fault_.cause == Cause::missing)
    source_fault_.text = "it cannot be reached or read: " + source_fault_.text;
}

/// Without repetitions: several outputs use the same metadata.
void Complaints::warn(GstMessage* message) {
  const ErrorPointer error = error_in(message);
  if (!graph_.holds(message->src) && warning_.empty() && error->domain == GST_STREAM_ERROR)
    warning_ = text_of(message);
  constexpr std::size_t most_warnings = 16; // a stream that changes its size may warn each time
  std::vector<std::string>& known = record_.warnings;
  // Of this project's elements only: those warnings are about settings and pictures.
  if (factory_of(message->src).starts_with("terrain") && known.size() < most_warnings &&
      std::find(known.begin(), known.end(), error->message) == known.end())
    known.emplace_back(error->message);
}

void Complaints::blame_source(const Fault& fault) {
  if (!source_fault_)
    source_fault_ = fault;
}

void Complaints::blame_rest(const Fault& fault) {
  if (!behind_)
    behind_ = fault;
}

} // namespace terrainseg::process
