// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/h264_unit.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "exchange/nal_units.hpp"

namespace terrainseg::recording {
namespace {

enum Type : std::uint8_t { slice = 1, idr_slice = 5, sequence_set = 7, picture_set = 8, delimiter = 9 };

/// Calls take(type, bytes without start code, including the header byte) for every NAL unit.
template <class Take> void for_each_nal(ByteView stream, Take take) {
  for (NalWalker nals(stream); nals.next();)
    if (const ByteView nal = nals.unit(); !nal.empty())
      take(static_cast<Type>(nal[0] & 31), nal);
}

/// The slice type: the second Exp-Golomb number of a slice header; -1 if the unit is too short.
int slice_type(ByteView nal) {
  std::size_t bit = 8;             // after the NAL header
  const auto next = [&]() -> int { // 0 past the end
    const bool set = bit < nal.size() * 8 && (nal[bit / 8] >> (7 - bit % 8) & 1) != 0;
    ++bit;
    return set;
  };
  int number = -1;
  for (int i = 0; i < 2; ++i) {
    int zeros = 0;
    while (next() == 0)
      if (++zeros > 25)
        return -1;
    number = 1;
    for (; zeros > 0; --zeros)
      number = 2 * number + next();
    --number;
  }
  return bit <= nal.size() * 8 ? number : -1;
}

} // namespace

H264Unit inspect_h264(ByteView unit) {
  H264Unit kind;
  bool sequence = false, picture = false;
  for_each_nal(unit, [&](Type type, ByteView nal) {
    kind.idr |= type == idr_slice;
    sequence |= type == sequence_set;
    picture |= type == picture_set;
    constexpr int b = 1, every = 5; // 5 to 9: all slices of the picture have this type
    if (type == slice)
      kind.b_slice |= slice_type(nal) % every == b;
  });
  kind.parameter_sets = sequence && picture;
  return kind;
}

ByteView ParameterSets::complete(ByteView unit) {
  const H264Unit kind = inspect_h264(unit);
  constexpr std::array<std::uint8_t, 4> code = {0, 0, 0, 1};
  std::size_t behind_delimiter = 0;
  for_each_nal(unit, [&](Type type, ByteView nal) {
    if (type == delimiter)
      behind_delimiter = static_cast<std::size_t>(nal.data() + nal.size() - unit.data());
    if (type != sequence_set && type != picture_set)
      return;
    Bytes& kept = type == sequence_set ? sequence_ : picture_;
    kept.assign(code.begin(), code.end());
    append(kept, nal);
  });
  begun_ = begun_ || (kind.idr && !sequence_.empty() && !picture_.empty());
  if (!begun_)
    return {};
  if (!kind.idr || kind.parameter_sets)
    return unit;
  completed_.clear();
  for (const ByteView part : {unit.first(behind_delimiter), ByteView(sequence_), ByteView(picture_),
                              unit.subspan(behind_delimiter)})
    append(completed_, part);
  return completed_;
}

} // namespace terrainseg::recording
