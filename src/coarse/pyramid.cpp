// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/pyramid.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory_resource>
#include <optional>
#include <span>
#include <vector>

#include "base/touch.hpp"
#include "base/workers.hpp"
#include "kernels/reduce.hpp"

namespace terrainseg {
namespace {

using kernels::Interleave;

constexpr int level_count = 7;
// Number of rows of a level in memory: three to start, three at an odd end, and the one that is written.
constexpr int ring_rows = 4;
constexpr std::ptrdiff_t row_alignment = 64;
constexpr int no_chroma = 128; // chroma of grey pictures
// Number of rows of the frame that are prefetched. With it 1080p NV12 from memory takes 0.45 ms instead of
// 0.73; reading alone takes 0.27.
constexpr int rows_ahead = 2;
// Largest distance of rows that are read through (see reads_through()).
constexpr std::ptrdiff_t longest_read_through = 2048;
// Each thread computes a band of the frame, down to the finest level that keeps all components. Coarser
// levels are small and are divided by components. A band overlaps its neighbours by two rows of every level,
// which are 45 rows of the frame at level 4. Smaller bands would cost more than they gain. There is one band
// per thread for the same reason: two threads at 4K take 0.70 ms, and 0.74 ms with two bands each.
constexpr int least_band_rows = 16;

std::ptrdiff_t aligned(std::ptrdiff_t bytes) {
  return (bytes + row_alignment - 1) / row_alignment * row_alignment;
}

// Whether the processor's own prefetch is quicker than prefetch instructions, when a plane is read from its
// first byte to its last. On AMD (Zen 4) it reads 29 GB/s, they 10 GB/s: a 1080p frame from memory takes 0.20
// ms instead of 0.28, though rows are read that are not needed. Of 4K rows too much is read: 0.93 ms instead
// of 0.77.
bool reads_through([[maybe_unused]] std::ptrdiff_t stride) {
#ifdef __x86_64__
  return stride > 0 && stride <= longest_read_through && __builtin_cpu_is("amd");
#else
  return false;
#endif
}

struct Shape {
  PixelFormat format{};
  int width = 0, height = 0;
  PyramidPlan plan;
  int bands = 0;
  bool operator==(const Shape&) const = default;
};

struct Rows {
  int first = 0, end = 0;
  bool holds(int y) const { return y >= first && y < end; }
};

// Components that are reduced together, and their layout.
struct Route {
  int components = 0;             ///< number of components
  std::array<int, 3> component{}; ///< Y U V or R G B
  std::array<int, 3> offset{};    ///< byte of each in a pixel
  Interleave interleave{};        ///< layout of the source rows
  int source_level = 0;           ///< level that has as many rows as the source
  bool vertical_first = false;    ///< 4:2:2 chroma: already as narrow as level 1
  int source_plane = 0;           ///< plane of the frame, or of the band's staged rows
  bool from_kept = false;         ///< the source is a kept level
};

// Conversion of the frame's rows to source rows.
enum class Staging {
  none,
  split, ///< packed 4:2:2: luma is staged as plane 0, chroma as plane 1
  narrow ///< samples of two bytes: each plane is staged
};

Staging staging_of(const FormatLayout& layout) {
  if (layout.sample_bytes() == 2)
    return Staging::narrow;
  return !layout.rgb && layout.planes == 1 && layout.component_count == 3 ? Staging::split : Staging::none;
}

// The layout when only the upper 8 bits are kept.
FormatLayout narrowed(FormatLayout layout) {
  for (ComponentLayout& part : layout.components) {
    part.offset = static_cast<std::uint8_t>(part.offset / layout.sample_bytes());
    part.step = static_cast<std::uint8_t>(part.step / layout.sample_bytes());
  }
  return layout;
}

std::vector<Route> routes_of(const FormatLayout& layout) {
  const auto& [a, b, c] = layout.components;
  if (layout.rgb)
    return {
        {3, {0, 1, 2}, {a.offset, b.offset, c.offset}, a.step == 3 ? Interleave::three : Interleave::four}};
  const bool packed = staging_of(layout) == Staging::split;
  std::vector<Route> routes{{1, {0}, {0}, Interleave::one}};
  const bool narrow_chroma = b.x_shift > b.y_shift, u_first = b.offset < c.offset;
  if (packed || layout.planes == 2)
    routes.push_back({2,
                      {1, 2},
                      {u_first ? 0 : 1, u_first ? 1 : 0},
                      Interleave::two,
                      b.y_shift,
                      narrow_chroma,
                      packed ? 1 : b.plane});
  else
    for (int i = 1; i < layout.component_count; ++i)
      routes.push_back({1, {i}, {0}, Interleave::one, b.y_shift, narrow_chroma, layout.components[i].plane});
  return routes;
}

// Rows in memory: all rows of a plane, or the last ones in a ring.
template <typename Byte> struct Lines {
  Byte* data = nullptr;
  std::ptrdiff_t stride = 0;
  int mask = ~0; ///< mask of the row's number

  Byte* row(int y) const { return data + stride * (y & mask); }
};

// The state of one level for one band and one route.
struct Step {
  Rows made;                       ///< first row of the band, and one past the last row made so far
  Rows own;                        ///< rows that this band writes into the kept planes
  int end = 0;                     ///< one past the last row that this band makes
  Lines<std::uint8_t> lines, ring; ///< memory of its own rows, and of the others
  int source_width = 0, source_height = 0;
  std::ptrdiff_t ahead = 0; ///< bytes from the rows that are read to those that are prefetched
  Interleave interleave{};  ///< layout of the rows that are read
  bool vertically = false;  ///< the rows that are read have the width of this level
  bool sparse = false;      ///< uses only every second row that is read
  bool begun = false;
  kernels::Waiting waiting;

  std::uint8_t* row(int y) const { return (own.holds(y) ? lines : ring).row(y); }
};

// The way of a route's rows through a band.
struct Course {
  Route route;
  int top = 0; ///< coarsest level that is made
  Rows source; ///< rows of the source that this band reads
  Lines<const std::uint8_t> source_lines;
  std::ptrdiff_t read_through =
      0; ///< bytes of each row that are read, needed or not; 0 = rows are prefetched
  std::array<Step, level_count> step;
};

// The next number of finer rows that is enough for one more row: an odd number, or all of them.
constexpr int next_that_allows(int available, int end) {
  return std::min(available + 1 + available % 2, end);
}

struct Band {
  std::vector<Course> courses;
  std::array<MutablePlane, 3> staged; ///< the last rows that were staged

  std::uint8_t* staged_row(int plane, int y) const { return staged[plane].row(y & (ring_rows - 1)); }
};

void reduce_sparsely(const Step& step, const std::uint8_t* row, std::uint8_t* out) {
  if (step.vertically)
    std::memcpy(out, row,
                static_cast<std::size_t>(step.source_width * kernels::written_step(step.interleave)));
  else
    kernels::reduce_horizontally(step.interleave, row, step.source_width, step.ahead, out);
}

void reduce(const Step& step, const std::uint8_t* odd, const std::uint8_t* even, std::uint8_t* out) {
  if (step.vertically)
    kernels::reduce_pair_vertically(odd, even, step.source_width * kernels::written_step(step.interleave),
                                    step.waiting, out);
  else
    kernels::reduce_pair(step.interleave, odd, even, step.source_width, step.ahead, step.waiting, out);
}

} // namespace

struct Pyramid::State {
  Shape shape;
  FormatLayout layout{}; ///< layout of bytes, also of staged rows
  Staging staging{};
  int split = 0; ///< the coarsest level that is computed in bands
  std::optional<std::pmr::monotonic_buffer_resource> memory;
  std::array<std::array<MutablePlane, 3>, level_count> planes;
  std::vector<Band> bands, tails; ///< tails: each component's levels that are coarser than `split`
  Frame frame;                    ///< the frame of the current build

  int width(int level) const { return subsampled(shape.width, level); }
  int height(int level) const { return subsampled(shape.height, level); }
  bool kept(int level, int component) const {
    const PyramidPlan& plan = shape.plan;
    return level <= plan.coarsest && level >= (component == 0 ? plan.finest_luma : plan.finest_color);
  }
  const ComponentLayout& part(int component) const { return layout.components[component]; }
  bool is_frame_plane(int component) const {
    const ComponentLayout& l = part(component);
    return component < layout.component_count && staging != Staging::narrow && l.step == 1 &&
           l.x_shift == 0 && l.y_shift == 0;
  }

  bool staged(const Route& route) const { return staging != Staging::none && !route.from_kept; }
  int sparse_of(const Route& route) const {
    return route.component[0] == 0 ? shape.plan.sparse_luma : shape.plan.sparse_color;
  }
  /// Number of source rows of which one is read.
  int rows_apart(const Route& route) const { return 1 << std::max(sparse_of(route) - route.source_level, 0); }

  void adopt(const Shape& wanted) {
    if (wanted == shape)
      return;
    shape = wanted;
    layout = narrowed(layout_of(shape.format));
    staging = staging_of(layout);
    const PyramidPlan& plan = shape.plan;
    split = shape.bands == 1 ? plan.coarsest : std::min(plan.coarsest, std::max(plan.finest_color, 1));
    bands.clear();
    tails.clear();
    memory.emplace(); // release() would compute in floating point
    for (int level = 0; level < level_count; ++level)
      for (int c = 0; c < 3; ++c) {
        planes[level][c] = {};
        if (!kept(level, c) || (level == 0 && is_frame_plane(c)))
          continue;
        const std::ptrdiff_t stride = aligned(width(level)), bytes = stride * height(level);
        planes[level][c] = {take(bytes), stride};
        if (c >= layout.component_count)
          std::memset(planes[level][c].data, no_chroma, static_cast<std::size_t>(bytes));
      }
    for (int i = 0; i < shape.bands; ++i)
      bands.push_back(band_of(i));
    for (int c = 0; c < layout.component_count && split < plan.coarsest; ++c) {
      const Route route{.components = 1,
                        .component = {c},
                        .interleave = Interleave::one,
                        .source_level = split,
                        .from_kept = true};
      tails.push_back({{course_of(route, plan.coarsest, 0)}, {}});
    }
  }

  // Aligned memory of zeros, valid until the next adopt().
  std::uint8_t* take(std::ptrdiff_t bytes) {
    const auto size = static_cast<std::size_t>(bytes);
    return static_cast<std::uint8_t*>(std::memset(memory->allocate(size, row_alignment), 0, size));
  }

  // A band owns rows of the coarsest level that is computed in bands, and the finer rows below them. Each
  // coarser level has one owner.
  Rows own_rows(int level, int index) const {
    if (level > split)
      return {0, height(level)};
    const int coarse = height(split), shift = split - level;
    // The first band has the smallest overlap, so it gets the remaining row.
    const auto cut = [&](int i) {
      return std::min(height(level), (coarse * i + shape.bands - 1) / shape.bands << shift);
    };
    return {cut(index), index + 1 == shape.bands ? height(level) : cut(index + 1)};
  }

  Band band_of(int index) {
    Band band;
    for (const Route& route : routes_of(layout))
      band.courses.push_back(course_of(route, split, index));
    if (staging == Staging::none)
      return band;
    const std::ptrdiff_t stride = aligned(shape.width + 1);
    for (int p = 0; p < (staging == Staging::split ? 2 : layout.planes); ++p)
      band.staged[p] = {take(stride * ring_rows), stride};
    return band;
  }

  Course course_of(const Route& route, int top, int index) {
    Course course;
    course.route = route;
    course.top = top;
    for (int level = top; level > route.source_level; --level) {
      Step& step = course.step[level];
      step.own = own_rows(level, index);
      step.made.first = step.own.first;
      step.end = step.own.end;
      // The rows that the coarser level reads: two more on each side.
      if (level < top) {
        const Step& coarser = course.step[level + 1];
        step.made.first = std::max(0, std::min(step.own.first, 2 * coarser.made.first - 2));
        step.end = std::min(height(level), std::max(step.own.end, 2 * coarser.end + 1));
      }
      step.vertically = route.vertical_first && level == 1;
      step.sparse = level <= sparse_of(route);
      step.source_width = step.vertically ? width(1) : width(level - 1);
      step.source_height = height(level - 1);
      const bool from_three = route.interleave == Interleave::three && level > 1;
      step.interleave = from_three ? Interleave::four : route.interleave;
      const std::ptrdiff_t bytes = std::ptrdiff_t{width(level)} * kernels::written_step(route.interleave);
      step.ring = {take(aligned(bytes) * ring_rows), aligned(bytes), ring_rows - 1};
      step.lines = step.ring;
      if (route.components == 1 && kept(level, route.component[0]))
        step.lines = {planes[level][route.component[0]].data, planes[level][route.component[0]].stride};
      // Aligns the second pixel, with which the loops start. Saves 4 % of the pyramid's time.
      const std::ptrdiff_t second = 2 * kernels::written_step(route.interleave);
      const auto take_sums = [&] {
        return reinterpret_cast<std::uint16_t*>(take(2 * bytes + row_alignment) + row_alignment - second);
      };
      step.waiting.partial = take_sums();
      step.waiting.held = take_sums();
    }
    if (top > route.source_level) {
      const Step& first = course.step[route.source_level + 1];
      course.source = {std::max(0, 2 * first.made.first - 2),
                       std::min(height(route.source_level), 2 * first.end + 1)};
    }
    return course;
  }

  void begin(const Band& band, Course& course) const {
    const Route& route = course.route;
    for (int level = route.source_level + 1; level <= course.top; ++level) {
      course.step[level].made.end = course.step[level].made.first;
      course.step[level].begun = false;
    }
    course.source_lines = source_of(band, route);
    const bool cached = staging != Staging::none || route.from_kept;
    const std::ptrdiff_t stride = course.source_lines.stride;
    course.read_through =
        !cached && reads_through(stride) ? row_bytes(layout, route.source_plane, shape.width) : 0;
    if (course.top > route.source_level)
      course.step[route.source_level + 1].ahead =
          cached || course.read_through > 0 ? 0 : stride * std::max(rows_ahead, rows_apart(route));
  }

  Lines<const std::uint8_t> source_of(const Band& band, const Route& route) const {
    if (route.from_kept) {
      const MutablePlane& plane = planes[route.source_level][route.component[0]];
      return {plane.data, plane.stride};
    }
    if (staged(route)) {
      const MutablePlane& rows = band.staged[route.source_plane];
      return {rows.data, rows.stride, ring_rows - 1};
    }
    const Plane& plane = frame.planes[route.source_plane];
    return {plane.data, plane.stride};
  }

  void deliver(const Route& route, int level, int y, const std::uint8_t* pixels) {
    const int step = kernels::written_step(route.interleave);
    for (int i = 0; i < route.components; ++i)
      if (kept(level, route.component[i]))
        kernels::spread(pixels, route.offset[i], step, 0, width(level),
                        planes[level][route.component[i]].row(y));
  }

  // Computes the rows of this level and of all coarser ones that rows 0..available-1 of the finer level
  // allow.
  void advance(Course& course, int level, int available) {
    const Route& route = course.route;
    Step& step = course.step[level];
    const int last = step.source_height - 1;
    const auto read = [&](int y) -> const std::uint8_t* {
      const int row = kernels::reflect_101(y, step.source_height);
      return level - 1 == route.source_level ? course.source_lines.row(row) : course.step[level - 1].row(row);
    };
    while (step.made.end < step.end) {
      const int y = step.made.end;
      std::uint8_t* const out = step.row(y);
      if (step.sparse) {
        if (2 * y >= available)
          return;
        // A sparse coarser level reads every second row.
        if (level == course.top || !course.step[level + 1].sparse || y % 2 == 0)
          reduce_sparsely(step, read(2 * y), out);
      } else {
        if (!step.begun) {
          if (std::min(std::max(2 * y, y == 0 ? 2 : 0), last) >= available)
            return;
          reduce(step, read(2 * y - 2), read(2 * y - 2), out);
          reduce(step, read(2 * y - 1), read(2 * y), out);
          step.begun = true;
        }
        if (std::min(2 * y + 2, last) >= available)
          return;
        reduce(step, read(2 * y + 1), read(2 * y + 2), out);
      }
      if (route.components > 1 && step.own.holds(y))
        deliver(route, level, y, out);
      ++step.made.end;
      if (level < course.top && (step.made.end % 2 != 0 || step.made.end == step.end))
        advance(course, level + 1, step.made.end);
    }
  }

  // One plane after the other, because prefetch follows one sequence of rows best; the two routes of packed
  // 4:2:2 together, because they share the frame's rows.
  void run(Band& band) {
    for (Course& course : band.courses)
      begin(band, course);
    const std::span<Course> all = band.courses;
    if (staging == Staging::split)
      return run_plane(band, all);
    for (std::size_t i = 0; i < all.size(); ++i)
      run_plane(band, all.subspan(i, 1));
  }

  // Runs routes that read the same rows.
  void run_plane(const Band& band, std::span<Course> courses) {
    const Course& first = courses[0];
    int apart = rows_apart(first.route);
    for (const Course& course : courses)
      apart = std::min(apart, rows_apart(course.route));
    for (int available = first.source.first; available < first.source.end;) {
      const int before = available;
      available = next_that_allows(available, first.source.end);
      if (staged(first.route)) {
        for (int y = before; y < available; ++y)
          if (y % apart == 0)
            stage(band, first.route.source_plane, y);
      } else if (first.read_through > 0) {
        for (int y = before; y < available - 1; ++y)
          touch(first.source_lines.row(y), first.read_through);
      }
      for (Course& course : courses)
        advance(course, course.route.source_level + 1, available);
    }
  }

  void narrow(int plane, int y, std::uint8_t* out) const {
    const Plane& source = frame.planes[plane];
    kernels::narrow(source.row(y), layout.upper_shift(), row_bytes(layout, plane, shape.width),
                    rows_ahead * source.stride, out);
  }

  // Converts row `y` of a plane of the frame to source rows.
  void stage(const Band& band, int plane, int y) const {
    if (staging == Staging::split)
      kernels::split_422(frame.planes[0].row(y), shape.width, part(0).offset == 0,
                         rows_ahead * frame.planes[0].stride, band.staged_row(0, y), band.staged_row(1, y));
    else
      narrow(plane, y, band.staged_row(plane, y));
  }

  void run_band(int index) {
    run(bands[index]);
    for (int c = 0; c < layout.component_count; ++c) {
      if (kept(0, c) && !is_frame_plane(c))
        fill_level(0, c, index);
      if (kept(1, c) && part(c).y_shift == 1)
        fill_level(1, c, index);
    }
  }

  // The samples of the frame, repeated where level 0 has more of them. Level 1 has as many as 4:2:0 chroma.
  // Samples of two bytes are converted into the memory of old staged rows.
  void fill_level(int level, int component, int index) {
    const ComponentLayout& l = part(component);
    const int y_shift = l.y_shift - level;
    const Rows rows = own_rows(level, index);
    for (int y = rows.first; y < rows.end; ++y) {
      std::uint8_t* out = planes[level][component].row(y);
      if (y_shift && y % 2 && y > rows.first) {
        std::memcpy(out, planes[level][component].row(y - 1), static_cast<std::size_t>(width(level)));
        continue;
      }
      const std::uint8_t* row = frame.planes[l.plane].row(y >> y_shift);
      if (staging == Staging::narrow) {
        std::uint8_t* const bytes = bands[index].staged_row(l.plane, 0);
        narrow(l.plane, y >> y_shift, bytes);
        row = bytes;
      }
      if (l.step == 1 && l.x_shift == level)
        std::memcpy(out, row, static_cast<std::size_t>(width(level)));
      else
        kernels::spread(row, l.offset, l.step, l.x_shift - level, width(level), out);
    }
  }
};

Pyramid::Pyramid() : state_(std::make_unique<State>()) {}
Pyramid::~Pyramid() = default;

void Pyramid::build(const Frame& frame, const PyramidPlan& plan, Workers* workers) {
  State& s = *state_;
  const int threads = workers ? workers->count() : 1;
  const int shared_level = std::min(plan.coarsest, std::max(plan.finest_color, 1));
  const int most = std::max(1, subsampled(frame.height, shared_level) / least_band_rows);
  const int bands = std::min(threads, most);
  s.adopt({frame.format, frame.width, frame.height, plan, bands});
  s.frame = frame;
  if (bands == 1)
    s.run_band(0);
  else
    workers->run(bands, [&s](int i) { s.run_band(i); });
  if (!s.tails.empty())
    workers->run(static_cast<int>(s.tails.size()), [&s](int c) { s.run(s.tails[c]); });
}

int Pyramid::width(int level) const {
  return state_->width(level);
}

int Pyramid::height(int level) const {
  return state_->height(level);
}

Plane Pyramid::plane(int level, int component) const {
  const State& s = *state_;
  if (level == 0 && s.is_frame_plane(component))
    return s.frame.planes[s.part(component).plane];
  const MutablePlane& p = s.planes[level][component];
  return {p.data, p.stride};
}

} // namespace terrainseg
