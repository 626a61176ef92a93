// SPDX-License-Identifier: LGPL-2.1-or-later
#include "pyramid.hpp"

#include <cstring>

#include "kernels/reduce.hpp"

namespace terrainseg {
namespace {

std::size_t area(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

// One component of a frame as a plane of its own, at its own sampling.
void gather(const Frame& frame, const ComponentLayout& layout, std::uint8_t* out) {
  const Plane& plane = frame.planes[layout.plane];
  const int width = subsampled(frame.width, layout.x_shift);
  const int height = subsampled(frame.height, layout.y_shift);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* in = plane.row(y) + layout.offset;
    for (int x = 0; x < width; ++x)
      *out++ = in[static_cast<std::ptrdiff_t>(x) * layout.step];
  }
}

} // namespace

int Pyramid::width(int level) const {
  return subsampled(shape_.width, level);
}

int Pyramid::height(int level) const {
  return subsampled(shape_.height, level);
}

Plane Pyramid::plane(int level, int component) const {
  return levels_[level][component].view;
}

bool Pyramid::kept(int level, int component) const {
  const PyramidPlan& plan = shape_.plan;
  return level <= plan.coarsest && level >= (component == 0 ? plan.finest_luma : plan.finest_color);
}

void Pyramid::adopt(const Shape& shape) {
  if (shape == shape_)
    return;
  shape_ = shape;
  const FormatLayout& layout = layout_of(shape.format);
  for (int level = 0; level < static_cast<int>(levels_.size()); ++level)
    for (int c = 0; c < 3; ++c) {
      const ComponentLayout& l = layout.components[c];
      const bool own_plane = level == 0 && l.step == 1 && l.x_shift == 0 && l.y_shift == 0;
      Kept& k = levels_[level][c];
      k.pixels.assign(kept(level, c) && !own_plane ? area(width(level), height(level)) : 0, 0);
      k.view = {k.pixels.data(), width(level)};
    }
  for (auto& s : scratch_)
    s.assign(area(shape.width, shape.height), 0);
}

void Pyramid::build(const Frame& frame, const PyramidPlan& plan) {
  adopt({frame.format, frame.width, frame.height, plan});
  const FormatLayout& layout = layout_of(frame.format);
  columns_.resize(frame.width);
  for (int c = 0; c < 3; ++c) {
    const ComponentLayout& l = layout.components[c];
    int w = subsampled(frame.width, l.x_shift), h = subsampled(frame.height, l.y_shift);
    Plane current = frame.planes[l.plane];
    int spare = 0;
    if (l.step != 1) {
      gather(frame, l, scratch_[spare].data());
      current = {scratch_[spare].data(), w};
      spare ^= 1;
    }
    if (kept(0, c)) {
      Kept& k = levels_[0][c];
      if (k.pixels.empty())
        k.view = current;
      for (int y = 0; !k.pixels.empty() && y < height(0); ++y)
        for (int x = 0; x < width(0); ++x)
          k.pixels[area(y, width(0)) + x] = current.row(y >> l.y_shift)[x >> l.x_shift];
    }
    for (int level = 1; level <= plan.coarsest; ++level) {
      const bool keep = kept(level, c);
      MutablePlane out{keep ? levels_[level][c].pixels.data() : scratch_[spare].data(), width(level)};
      if (level == 1 && l.x_shift == 1 && l.y_shift == 1) {
        if (!keep)
          continue;
        for (int y = 0; y < h; ++y)
          std::memcpy(out.row(y), current.row(y), w);
      } else if (level == 1 && l.x_shift == 1) {
        kernels::reduce_rows(current, w, h, out);
      } else {
        kernels::reduce(current, w, h, out, columns_.data());
      }
      w = width(level);
      h = height(level);
      current = {out.data, out.stride};
      if (!keep)
        spare ^= 1;
    }
  }
}

} // namespace terrainseg
