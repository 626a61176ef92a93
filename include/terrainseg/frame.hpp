// SPDX-License-Identifier: LGPL-2.1-or-later
// A video frame as the core sees it: planes that somebody else owns, in the memory layout they came in.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "terrainseg/export.hpp"

namespace terrainseg {

/// The raw formats that are read and drawn natively; the names are GStreamer's.
enum class PixelFormat : std::uint8_t {
  I420,
  YV12,
  NV12,
  NV21,
  Y42B,
  Y444,
  YUY2,
  UYVY,
  RGB,
  BGR,
  RGBx,
  BGRx,
  xRGB,
  xBGR,
  RGBA,
  BGRA,
  ARGB,
  ABGR,
  NV16,
  NV61,
  NV24,
  YVYU,
  VYUY,
  GRAY8,
  GRAY16_LE,
  P010_10LE,
  I420_10LE,
  I422_10LE
};
inline constexpr int pixel_format_count = 28;

enum class ColorRange : std::uint8_t { limited, full };
enum class ColorMatrix : std::uint8_t { bt601, bt709, bt2020 };

/// How numbers stand for colours. The matrix means nothing for the RGB formats.
struct Colorimetry {
  ColorRange range = ColorRange::limited;
  ColorMatrix matrix = ColorMatrix::bt601;
  bool operator==(const Colorimetry&) const = default;
};

/// Where one of the components (Y, U, V or R, G, B) of a pixel lies. Samples of more than 8 bits are two
/// bytes, the lower first.
struct ComponentLayout {
  std::uint8_t plane;   ///< index into Frame::planes
  std::uint8_t offset;  ///< bytes from the start of a row to the first sample
  std::uint8_t step;    ///< bytes from one sample to the next in a row
  std::uint8_t x_shift; ///< log2 of the horizontal subsampling
  std::uint8_t y_shift; ///< log2 of the vertical subsampling
};

struct FormatLayout {
  std::array<ComponentLayout, 3> components; ///< Y, U, V or R, G, B, in this order for every format
  std::uint8_t planes;                       ///< number of planes, 1..3
  bool rgb;                                  ///< true: components are R, G, B
  std::uint8_t component_count = 3;          ///< 3, or 1: grey, read as if its chroma were 128 everywhere
  std::uint8_t depth = 8;                    ///< bits of a sample: 8, 10 or 16; the upper 8 are read
  std::uint8_t shift = 0;                    ///< unused bits below a sample
  /// The components that are in memory.
  constexpr std::span<const ComponentLayout> parts() const { return {components.data(), component_count}; }
  constexpr int sample_bytes() const { return depth > 8 ? 2 : 1; }
  /// How far to the right the upper 8 bits of a sample's word lie: 0 where a sample is a byte.
  constexpr int upper_shift() const { return depth - 8 + shift; }
};

/// The layout of a format: a table look-up, never fails.
TERRAINSEG_API const FormatLayout& layout_of(PixelFormat format);

/// Samples of a subsampled component along an axis of `size` pixels: ceil(size / 2^shift).
constexpr int subsampled(int size, int shift) {
  return (size + (1 << shift) - 1) >> shift;
}

/// Bytes of a row of one plane of a frame `width` pixels wide: whole pixels, also with a byte that is not
/// read, and in packed 4:2:2 whole pairs of pixels, also where the width is odd.
constexpr int row_bytes(const FormatLayout& layout, int plane, int width) {
  int bytes = 0;
  for (const ComponentLayout& part : layout.parts())
    if (const int needed = subsampled(width, part.x_shift) * part.step; part.plane == plane && needed > bytes)
      bytes = needed;
  return bytes;
}

/// Rows of a plane of a frame of `height` rows. `plane` in 0..layout.planes - 1.
constexpr int plane_rows(const FormatLayout& layout, int plane, int height) {
  int rows = 0;
  for (const ComponentLayout& part : layout.parts())
    if (part.plane == plane)
      rows = subsampled(height, part.y_shift);
  return rows;
}

/// A read-only plane. Rows are `stride` bytes apart; the stride may exceed the row or be negative.
struct Plane {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;
  const std::uint8_t* row(int y) const { return data + y * stride; }
};

/// A writable plane.
struct MutablePlane {
  std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;
  std::uint8_t* row(int y) const { return data + y * stride; }
};

/// Position and size in pixels of the frame. Empty when a side is 0 or less.
struct Rectangle {
  int x = 0, y = 0, width = 0, height = 0;
  constexpr bool empty() const { return width <= 0 || height <= 0; }
  bool operator==(const Rectangle&) const = default;
};

/// A frame to look at: non-owning. Planes are in the memory order of the format (YV12: Y, V, U); every plane
/// holds at least subsampled(height, y_shift) rows of row_bytes().
struct Frame {
  PixelFormat format = PixelFormat::I420;
  int width = 0;  ///< pixels, 1..32767
  int height = 0; ///< pixels, 1..32767
  Colorimetry colorimetry;
  std::array<Plane, 3> planes;
  /// Presentation time in nanoseconds, -1 = unknown. More than 2 s from the last frame's, forwards or back,
  /// ends the averaging of scores with temporal = auto; more than 2 s forwards, or any step back, ends what
  /// motion knows, which also takes speed from it and looks at no frame within 45 ms of the last one that it
  /// looked at.
  std::int64_t pts = -1;
  /// Where a pose or a mount has the vanishing line of level ground at the middle of the width: Q8 rows of
  /// the frame, may lie outside. Ground ends there, unless motion sees for some seconds that it slopes;
  /// Settings::vanishing_row stands above it.
  std::optional<std::int32_t> vanishing_row = std::nullopt;
};

/// A frame to draw on.
struct MutableFrame {
  PixelFormat format = PixelFormat::I420;
  int width = 0;
  int height = 0;
  Colorimetry colorimetry;
  std::array<MutablePlane, 3> planes;
};

/// An 8-bit picture of one channel that somebody else owns.
struct GrayView {
  Plane plane;
  int width = 0, height = 0;
  bool empty() const { return plane.data == nullptr || width <= 0 || height <= 0; }
};

} // namespace terrainseg
