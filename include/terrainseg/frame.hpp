// SPDX-License-Identifier: LGPL-2.1-or-later
// A video frame for the core: non-owning views of the planes, in their original memory layout.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "terrainseg/export.hpp"

namespace terrainseg {

/// The raw formats that are read and drawn without conversion. The names are GStreamer's.
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

/// Colour range and Y'CbCr matrix of a frame. The matrix is not used for RGB formats.
struct Colorimetry {
  ColorRange range = ColorRange::limited;
  ColorMatrix matrix = ColorMatrix::bt601;
  bool operator==(const Colorimetry&) const = default;
};

/// Memory layout of one component (Y, U, V or R, G, B). Samples of more than 8 bits are two bytes,
/// little-endian.
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
  std::uint8_t component_count = 3; ///< 3, or 1 for grey, which is read as if its chroma were 128 everywhere
  std::uint8_t depth = 8;           ///< bits per sample: 8, 10 or 16; only the upper 8 are read
  std::uint8_t shift = 0;           ///< unused low-order bits of a sample
  /// The components that are stored in memory.
  constexpr std::span<const ComponentLayout> parts() const { return {components.data(), component_count}; }
  constexpr int sample_bytes() const { return depth > 8 ? 2 : 1; }
  /// Right shift that gives the upper 8 bits of a sample's word; 0 for samples of one byte.
  constexpr int upper_shift() const { return depth - 8 + shift; }
};

/// Returns the layout of a format by table look-up. Never fails.
TERRAINSEG_API const FormatLayout& layout_of(PixelFormat format);

/// Number of samples of a subsampled component along an axis of `size` pixels: ceil(size / 2^shift).
constexpr int subsampled(int size, int shift) {
  return (size + (1 << shift) - 1) >> shift;
}

/// Bytes in a row of one plane of a frame `width` pixels wide. Counts whole pixels, including bytes that are
/// not read. Packed 4:2:2 counts whole pairs of pixels, also for an odd width.
constexpr int row_bytes(const FormatLayout& layout, int plane, int width) {
  int bytes = 0;
  for (const ComponentLayout& part : layout.parts())
    if (const int needed = subsampled(width, part.x_shift) * part.step; part.plane == plane && needed > bytes)
      bytes = needed;
  return bytes;
}

/// Number of rows of a plane in a frame of `height` rows. `plane` is in 0..layout.planes - 1.
constexpr int plane_rows(const FormatLayout& layout, int plane, int height) {
  int rows = 0;
  for (const ComponentLayout& part : layout.parts())
    if (part.plane == plane)
      rows = subsampled(height, part.y_shift);
  return rows;
}

/// A read-only plane. Rows are `stride` bytes apart. The stride may be larger than the row or negative.
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

/// A rectangle in pixels of the frame. Empty when its width or height is 0 or less.
struct Rectangle {
  int x = 0, y = 0, width = 0, height = 0;
  constexpr bool empty() const { return width <= 0 || height <= 0; }
  bool operator==(const Rectangle&) const = default;
};

/// Frames at a shorter interval, in nanoseconds, share work: see Frame::pts.
inline constexpr std::int64_t half_rate_interval = 45'000'000;

/// A non-owning, read-only frame. Planes are in the memory order of the format (YV12: Y, V, U). Every plane
/// holds at least subsampled(height, y_shift) rows of row_bytes() bytes.
struct Frame {
  PixelFormat format = PixelFormat::I420;
  int width = 0;  ///< pixels, 1..32767
  int height = 0; ///< pixels, 1..32767
  Colorimetry colorimetry;
  std::array<Plane, 3> planes;
  /// Presentation time in nanoseconds, -1 = unknown. A difference of more than 2 s from the previous frame,
  /// in either direction, ends the averaging of scores with temporal = auto. More than 2 s forwards, or any
  /// step backwards, resets motion. Motion also computes the speed from it, and skips a frame that follows
  /// the last one it used within half_rate_interval. In frames that follow so soon and have moved by
  /// less than a third of a cell, spots near by and stones take turns with spots far away: those that wait
  /// stay where the frame before had them.
  std::int64_t pts = -1;
  /// Vanishing line of level ground at the middle of the width, from a pose or a mount: Q8 rows of the frame,
  /// may lie outside the frame. The ground ends there, unless motion measures for some seconds that the
  /// ground slopes. Settings::vanishing_row has priority.
  std::optional<std::int32_t> vanishing_row = std::nullopt;
};

/// A non-owning, writable frame.
struct MutableFrame {
  PixelFormat format = PixelFormat::I420;
  int width = 0;
  int height = 0;
  Colorimetry colorimetry;
  std::array<MutablePlane, 3> planes;
};

/// A non-owning 8-bit picture of one channel.
struct GrayView {
  Plane plane;
  int width = 0, height = 0;
  bool empty() const { return plane.data == nullptr || width <= 0 || height <= 0; }
};

} // namespace terrainseg
