// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts an estimate to one KLV unit and back. The unit is a MISB ST 0903 VMTI Local Set, which any VMTI
// decoder reads (the mask as run lengths, the horizon as a target). A private Local Set in it holds the other
// fields, so decode() returns what encode() received. The set is alone or inside a MISB ST 0601 UAS Datalink
// Local Set. Layout: docs/klv.md.
//
// Integers only, no GStreamer. Numbers in a unit are big-endian, as MISB requires.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Maximum size of a unit, bytes. mpegtsmux drops KLV of more than 65532 bytes with only a warning.
inline constexpr std::size_t klv_unit_limit = 60000;
/// Maximum number of mask pixels that are sent at full size or accepted: 8192 x 8192.
inline constexpr std::int64_t klv_mask_limit = std::int64_t{1} << 26;

inline constexpr std::array<std::uint8_t, 16> vmti_label = {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01,
                                                            0x0e, 0x01, 0x03, 0x03, 0x06, 0x00, 0x00, 0x00};
inline constexpr std::array<std::uint8_t, 16> uas_label = {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01,
                                                           0x0e, 0x01, 0x03, 0x01, 0x01, 0x00, 0x00, 0x00};
/// Class 15 of SMPTE (experimental), then "TRNSEG" and 1.
inline constexpr std::array<std::uint8_t, 16> terrain_label = {
    0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0f, 'T', 'R', 'N', 'S', 'E', 'G', 0x01};
inline constexpr std::uint8_t terrain_set_version = 1;

// Position and attitude of the camera as items of the UAS Datalink Local Set. ST 0601 maps ranges of degrees
// and metres linearly to integers (table: docs/klv.md).

/// Angles to the horizontal plane, in degrees. The platform of ST 0601 is the camera: its axes are the
/// camera's.
struct UasAttitude {
  double pitch = 0; ///< positive = looks up
  double roll = 0;  ///< positive = right side down
};

struct UasPosition {
  double latitude = 0;  ///< degrees, -90..90, north is positive
  double longitude = 0; ///< degrees, -180..180, east is positive
  double altitude = 0;  ///< metres above mean sea level, -900..19000
};

/// The known values of the platform. Unknown values are not written.
struct UasPlatform {
  std::optional<double> heading; ///< direction of the camera, degrees clockwise from north, any value
  std::optional<UasAttitude> attitude;
  std::optional<UasPosition> position;
};

/// Parses `latitude,longitude,altitude` or `latitude,longitude,altitude,heading` (degrees, metres, decimal
/// points). Returns nullptr, or the error as the end of a sentence; then `platform` is unchanged.
const char* read_position(std::string_view text, UasPlatform& platform);

/// Appends the items of the known values.
void put_platform(std::vector<std::uint8_t>& set, const UasPlatform& platform);

/// Encodes units. Keeps its buffers: no allocation after the largest frame.
class KlvEncoder {
 public:
  /// Returns the unit, valid until the next call; empty if the estimate has no mask. Requires a valid
  /// estimate (flaw_of()): the decoder refuses others. `time_us` is the precision time stamp in microseconds.
  /// A mask whose runs do not fit, or that is larger than its frame (the frame was scaled, masks are not), is
  /// halved with its boundary until it fits: a pixel gets the lowest of four values, a column the nearer of
  /// two rows. Halving never adds free space. With `platform` the unit is a UAS Datalink Local Set with the
  /// known values of the platform.
  std::span<const std::uint8_t> encode(const Estimate& estimate, std::uint64_t time_us,
                                       const UasPlatform* platform = nullptr);

 private:
  bool halve(GrayView& mask, std::span<const std::uint16_t>& boundary);
  bool write(const Estimate& estimate, const GrayView& mask, std::span<const std::uint16_t> boundary,
             std::uint64_t time_us, const UasPlatform* platform);
  void nest(const UasPlatform& platform, std::uint64_t time_us, std::size_t vmti_size);

  void put_terrain_set(const Estimate& estimate, std::span<const std::uint16_t> boundary);

  std::vector<std::uint8_t> unit_, set_, traversable_, doubtful_, extra_;
  std::array<std::vector<std::uint8_t>, 2> halved_masks_;
  std::array<std::vector<std::uint16_t>, 2> halved_boundaries_;
  unsigned halvings_ = 0;
};

enum class KlvVerdict : std::uint8_t {
  ok,
  foreign, ///< complete, but not from terrainseg, or from a newer version
  damaged, ///< lengths, checksums or values that no encoder writes
};

/// A decoded unit. Keeps its buffers for the next decode().
class KlvUnit {
 public:
  /// Reads a unit. If the result is not ok, the content is unspecified and error() has the reason. Safe for
  /// untrusted input: every length is checked. Time and memory are linear in the number of bytes; drawing is
  /// linear in the mask, which is not larger than the frame given in the unit.
  KlvVerdict decode(std::span<const std::uint8_t> bytes);
  const std::string& error() const { return error_; }

  /// Everything but the mask's pixels: mask.plane.data is null, mask.width and height are set. The boundary
  /// is a view into this unit.
  const Estimate& estimate() const { return estimate_; }
  std::uint64_t time_us() const { return time_us_; }

  // Limits of the work for a unit, for tests.
  /// Number of bytes that draw_mask() writes: at most three times the mask's pixels.
  std::uint64_t pixels_to_draw() const;
  std::size_t runs() const { return runs_.size(); } ///< at most a quarter of the unit's bytes
  /// Draws the mask: estimate().mask.height rows of estimate().mask.width bytes each.
  void draw_mask(const MutablePlane& target) const;

 private:
  struct Run {
    std::uint32_t start, length;
    std::uint8_t value;
  };
  using View = std::span<const std::uint8_t>;
  // These throw the reason why they refuse the unit.
  void read(View bytes);
  void read_nested(View unit, View set);
  void read_vmti(View head, View set);
  void read_terrain_set(View set);
  void read_targets(View series, std::uint64_t width, std::uint64_t height);
  void read_mask(View pack, const std::string& target, std::uint8_t value);
  void read_runs(View series, std::uint8_t value);

  std::string error_;
  std::vector<std::uint8_t> head_; ///< label and length of a nested set as it would stand alone
  Estimate estimate_;
  std::vector<std::uint16_t> boundary_;
  std::vector<Run> runs_;
  std::uint64_t time_us_ = 0;
};

} // namespace terrainseg
