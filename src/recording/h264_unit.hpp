// SPDX-License-Identifier: LGPL-2.1-or-later
// H.264 access units as recordings want them: Annex B, parameter sets with every IDR picture, no B-frames.
#pragma once

#include "recording/little_endian.hpp"

namespace terrainseg::recording {

/// What an access unit holds.
struct H264Unit {
  bool idr = false;            ///< a picture that decoding can begin with
  bool parameter_sets = false; ///< a sequence and a picture parameter set
  bool b_slice = false;        ///< a picture that waits for a later one
};
H264Unit inspect_h264(ByteView unit);

/// Keeps the last parameter sets, and puts them into IDR units that come without.
class ParameterSets {
 public:
  /// The unit as it is recorded, valid until the next call; empty while decoding cannot begin yet. `unit`
  /// must be sound Annex B with start codes.
  ByteView complete(ByteView unit, const H264Unit& kind);

 private:
  Bytes sequence_, picture_; ///< with their start codes
  bool begun_ = false;
  Bytes completed_;
};

} // namespace terrainseg::recording
