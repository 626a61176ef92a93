// SPDX-License-Identifier: LGPL-2.1-or-later
// How a camera was turned when it took a picture, by the picture's EXIF data.
#pragma once

#include <cstdint>
#include <span>

namespace terrainseg::process {

/// The EXIF orientation of a JPEG, PNG, WebP or TIFF file, 1 to 8; 1 (upright) where it has none.
int exif_orientation(std::span<const std::uint8_t> file);

/// The value of GStreamer's tag `image-orientation` for it.
const char* orientation_tag(int orientation);

} // namespace terrainseg::process
