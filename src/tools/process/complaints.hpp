// SPDX-License-Identifier: LGPL-2.1-or-later
// What the elements of a run report on its bus: errors, warnings, missing decoders.
#pragma once

#include <gst/gst.h>

#include <string>

#include "tools/process/faults.hpp"
#include "tools/process/graph.hpp"
#include "tools/process/output_files.hpp"

namespace terrainseg::process {

/// The first error of each side is kept. The thread that controls the run only.
class Complaints {
 public:
  Complaints(const Graph& graph, OutputFiles& files, Record& record)
      : graph_(graph), files_(files), record_(record) {}

  /// Waits for a message at most `timeout`, then takes all that are there.
  void take_all(GstBus* bus, GstClockTime timeout);
  /// Faults that no element reports; the first fault counts.
  void blame_source(const Fault& fault);
  void blame_rest(const Fault& fault);

  const Fault& source() const { return source_fault_; }                   ///< of the input
  const Fault& behind_source() const { return behind_; }                  ///< settings, encoders, disk
  bool source_gave_up() const { return gave_up_; }                        ///< without an error that says why
  const std::string& decoder_warning() const { return warning_; }         ///< the first
  const std::string& missing_decoder() const { return missing_decoder_; } ///< why, and what to do

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
