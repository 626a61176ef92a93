// SPDX-License-Identifier: LGPL-2.1-or-later
// Collects the messages of a pipeline's elements: errors, warnings, missing decoders.
#pragma once

#include <gst/gst.h>

#include <string>

#include "tools/process/faults.hpp"
#include "tools/process/graph.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

/// Keeps the first error of the source and of the other elements. Used by the controlling thread only.
class Complaints {
 public:
  Complaints(const Graph& graph, OutputFiles& files, Record& record)
      : graph_(graph), files_(files), record_(record) {}

  /// Waits at most `timeout` for a message, then processes all pending ones.
  void take_all(GstBus* bus, GstClockTime timeout);
  /// Faults without an error message; the first one is kept.
  void blame_source(const Fault& fault);
  void blame_rest(const Fault& fault);

  const Fault& source() const { return source_fault_; }  ///< of the input
  const Fault& behind_source() const { return behind_; } ///< of settings, encoders or the disk
  bool source_gave_up() const { return gave_up_; }       ///< stopped without the error that has the cause
  const std::string& decoder_warning() const { return warning_; }         ///< the first one
  const std::string& missing_decoder() const { return missing_decoder_; } ///< cause and remedy

 private:
  void take(GstMessage* message);
  void take_error(GstMessage* message);
  void warn(GstMessage* message);

  const Graph& graph_;
  OutputFiles& files_;
  Record& record_;
  Fault source_fault_, behind_;
  bool gave_up_ = false;
  std::string warning_, missing_decoder_;
};

} // namespace terrainseg::process
