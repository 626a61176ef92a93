// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts H.264 access units for recordings: Annex B, parameter sets with every IDR picture, no B-frames.
#pragma once

#include "recording/cdr.hpp"

namespace terrainseg::recording {

/// Content of an access unit.
struct H264Unit {
  bool idr = false;            ///< an IDR picture, at which decoding can start
  bool parameter_sets = false; ///< a sequence and a picture parameter set
  bool b_slice = false;        ///< a picture that may refer to a later one
};
H264Unit inspect_h264(ByteView unit);

/// Stores the last parameter sets and inserts them into IDR units without them.
class ParameterSets {
 public:
  /// Returns the unit to record, valid until the next call; empty before the first unit at which decoding can
  /// start. `unit` must be valid Annex B with start codes.
  ByteView complete(ByteView unit);

 private:
  Bytes sequence_, picture_; ///< with start codes
  bool begun_ = false;
  Bytes completed_;
};

} // namespace terrainseg::recording
