// SPDX-License-Identifier: LGPL-2.1-or-later
// KLV units from anywhere. The input is decoded as it is, then with its checksums put right, since no fuzzer
// guesses a CRC. What decodes must keep its promises and survive being sent on.
#include "exchange/vmti_klv.hpp"
#include "input.hpp"
#include "klv_sums.hpp"

namespace {

using namespace terrainseg;
using fuzz::require;

bool inside(const Rectangle& r, int width, int height) {
  return r.x >= 0 && r.y >= 0 && r.width >= 0 && r.height >= 0 && r.x + r.width <= width &&
         r.y + r.height <= height;
}

void check(const KlvUnit& unit, std::size_t unit_size) {
  const Estimate& e = unit.estimate();
  // Work is linear in the unit's bytes and the mask's, and the mask is bounded by its frame.
  require(unit.runs() <= unit_size / 4);
  require(unit.pixels_to_draw() <=
          3 * static_cast<std::uint64_t>(e.mask.width) * static_cast<std::uint64_t>(e.mask.height));
  require(e.mask.width <= e.frame_width && e.mask.height <= e.frame_height);
  require(flaw_of(e) == nullptr);
  require(e.frame_width >= 1 && e.frame_width <= 32767 && e.frame_height >= 1 && e.frame_height <= 32767);
  require(e.mask.width >= 1 && e.mask.height >= 1);
  require(std::int64_t{e.mask.width} * e.mask.height <= klv_mask_limit);
  require(e.horizon_row >= -1 && e.horizon_row < e.frame_height);
  require(inside(e.window, e.frame_width, e.frame_height) &&
          inside(e.mask_region, e.frame_width, e.frame_height));
  require(e.boundary.empty() || e.boundary.size() == static_cast<std::size_t>(e.mask.width));
  for (const std::uint16_t row : e.boundary)
    require(row <= e.frame_height);
  require(e.model_count >= 0 && e.model_count <= max_models);
  require(e.traversable_permille >= 0 && e.traversable_permille <= 1000);
  if (e.mask.width * e.mask.height > 1 << 16)
    return;

  static std::vector<std::uint8_t> pixels;
  pixels.assign(static_cast<std::size_t>(e.mask.width) * static_cast<std::size_t>(e.mask.height), 1);
  unit.draw_mask({pixels.data(), e.mask.width});
  for (const std::uint8_t pixel : pixels)
    require(pixel == mask_not_traversable || pixel == mask_doubtful || pixel == mask_traversable);

  Estimate again = e;
  again.mask.plane = {pixels.data(), e.mask.width};
  static KlvEncoder encoder;
  static KlvUnit second;
  static const UasPlatform platform = {90, UasAttitude{-5, 2}, UasPosition{52.5, 13.4, 34}};
  for (const UasPlatform* around : {static_cast<const UasPlatform*>(nullptr), &platform}) {
    const auto bytes = encoder.encode(again, unit.time_us(), around);
    require(!bytes.empty() && bytes.size() <= klv_unit_limit);
    require(second.decode(bytes) == KlvVerdict::ok);
    require(second.estimate().horizon_row == e.horizon_row && second.estimate().frame == e.frame);
  }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static KlvUnit unit;
  const KlvVerdict verdict = unit.decode({data, size});
  require((verdict == KlvVerdict::ok) == unit.error().empty());
  if (verdict == KlvVerdict::ok)
    check(unit, size);
  std::vector<std::uint8_t> whole(data, data + size);
  put_sums(whole);
  if (unit.decode(whole) == KlvVerdict::ok)
    check(unit, size);
  return 0;
}
