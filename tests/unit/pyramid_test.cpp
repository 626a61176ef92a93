// SPDX-License-Identifier: LGPL-2.1-or-later
// The pyramid against cv::pyrDown, bit for bit, in every format and memory layout.
#include "base/workers.hpp"
#include "coarse/pyramid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <random>

namespace {

using namespace terrainseg;

// A frame of any format in memory of its own: padded strides, and upside down where `flipped`.
struct OwnedFrame {
  std::array<std::vector<std::uint8_t>, 3> memory;
  Frame frame;

  OwnedFrame(PixelFormat format, int width, int height, std::uint32_t seed, int padding = 0,
             bool flipped = false) {
    frame.format = format;
    frame.width = width;
    frame.height = height;
    std::mt19937 random(seed);
    const FormatLayout& layout = layout_of(format);
    for (int p = 0; p < layout.planes; ++p) {
      const int stride = row_bytes(layout, p, width) + padding, rows = plane_rows(layout, p, height);
      memory[p].resize(static_cast<std::size_t>(stride) * rows);
      // Runs of extremes between the noise: sums that would overflow show.
      for (std::uint8_t& byte : memory[p]) {
        const auto r = static_cast<std::uint32_t>(random());
        byte = (r & 0x300) == 0 ? 255 : static_cast<std::uint8_t>(r);
      }
      frame.planes[p] = {memory[p].data(), stride};
      if (flipped)
        frame.planes[p] = {memory[p].data() + static_cast<std::ptrdiff_t>(stride) * (rows - 1), -stride};
    }
  }
};

// What is read of a sample: a byte, or the upper 8 bits of what the format's two bytes hold.
std::uint8_t read(PixelFormat format, const std::uint8_t* sample) {
  switch (format) {
  case PixelFormat::P010_10LE:
  case PixelFormat::GRAY16_LE:
    return sample[1];
  case PixelFormat::I420_10LE:
  case PixelFormat::I422_10LE:
    return static_cast<std::uint8_t>((sample[1] * 256 + sample[0]) / 4 % 256);
  default:
    return *sample;
  }
}

cv::Mat component_of(const Frame& frame, int component) {
  const bool gray = frame.format == PixelFormat::GRAY8 || frame.format == PixelFormat::GRAY16_LE;
  if (gray && component > 0)
    return {frame.height, frame.width, CV_8U, cv::Scalar(128)};
  const ComponentLayout& l = layout_of(frame.format).components[component];
  cv::Mat out(subsampled(frame.height, l.y_shift), subsampled(frame.width, l.x_shift), CV_8U);
  for (int y = 0; y < out.rows; ++y) {
    const std::uint8_t* sample = frame.planes[l.plane].row(y) + l.offset;
    auto* to = out.ptr<std::uint8_t>(y);
    for (int x = 0; x < out.cols; ++x)
      to[x] = read(frame.format, sample + x * l.step);
  }
  return out;
}

// 4:2:2 chroma, level 1: the column filter of cv::pyrDown alone.
cv::Mat column_reduced(const cv::Mat& source) {
  const int weights[5] = {1, 4, 6, 4, 1};
  cv::Mat padded, out((source.rows + 1) / 2, source.cols, CV_8U);
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x) {
      int sum = 8;
      for (int k = 0; k < 5; ++k)
        sum += weights[k] * source.at<std::uint8_t>(
                                cv::borderInterpolate(2 * y + k - 2, source.rows, cv::BORDER_REFLECT_101), x);
      out.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(sum / 16);
    }
  return out;
}

cv::Mat every_second_row(const cv::Mat& source) {
  cv::Mat out((source.rows + 1) / 2, source.cols, CV_8U);
  for (int y = 0; y < out.rows; ++y)
    source.row(2 * y).copyTo(out.row(y));
  return out;
}

// A sparse level: the row filter of cv::pyrDown alone, in every second row.
cv::Mat row_reduced(const cv::Mat& source) {
  return column_reduced(every_second_row(source).t()).t();
}

std::vector<cv::Mat> oracle(const Frame& frame, int component, int coarsest, int sparse) {
  const ComponentLayout& l = layout_of(frame.format).components[component];
  const cv::Mat own = component_of(frame, component);
  std::vector<cv::Mat> levels;
  cv::Mat repeated(frame.height, frame.width, CV_8U);
  for (int y = 0; y < frame.height; ++y) {
    const auto* from = own.ptr<std::uint8_t>(y >> l.y_shift);
    auto* to = repeated.ptr<std::uint8_t>(y);
    for (int x = 0; x < frame.width; ++x)
      to[x] = from[x >> l.x_shift];
  }
  levels.push_back(repeated);
  for (int level = 1; level <= coarsest; ++level) {
    cv::Mat next;
    if (level == 1 && l.x_shift && l.y_shift)
      next = own;
    else if (level == 1 && l.x_shift)
      next = level <= sparse ? every_second_row(own) : column_reduced(own);
    else if (level <= sparse)
      next = row_reduced(levels.back());
    else
      cv::pyrDown(levels.back(), next);
    levels.push_back(next);
  }
  return levels;
}

/// Every level of the three components, the coarsest last.
struct Oracle {
  std::array<std::vector<cv::Mat>, 3> levels;

  Oracle(const Frame& frame, int coarsest, int sparse_luma = 0, int sparse_color = 0) {
    for (int c = 0; c < 3; ++c)
      levels[c] = oracle(frame, c, coarsest, c == 0 ? sparse_luma : sparse_color);
  }
};

void expect_same(const Pyramid& pyramid, const Frame& frame, const PyramidPlan& plan, const Oracle& oracle) {
  for (int c = 0; c < 3; ++c)
    for (int level = c == 0 ? plan.finest_luma : plan.finest_color; level <= plan.coarsest; ++level) {
      const cv::Mat& expected = oracle.levels[c][level];
      ASSERT_EQ(pyramid.width(level), expected.cols);
      ASSERT_EQ(pyramid.height(level), expected.rows);
      const Plane plane = pyramid.plane(level, c);
      for (int y = 0; y < expected.rows; ++y) {
        const std::uint8_t* row = expected.ptr<std::uint8_t>(y);
        const auto differs = std::mismatch(row, row + expected.cols, plane.row(y)).first - row;
        ASSERT_EQ(differs, expected.cols)
            << "format " << static_cast<int>(frame.format) << " " << frame.width << "x" << frame.height
            << " level " << level << " component " << c << " at " << differs << "," << y;
      }
    }
}

void expect_same(const Pyramid& pyramid, const Frame& frame, const PyramidPlan& plan) {
  expect_same(pyramid, frame, plan, Oracle(frame, plan.coarsest, plan.sparse_luma, plan.sparse_color));
}

TEST(Pyramid, EverySizeUpTo64) {
  Pyramid pyramid;
  for (int h = 1; h <= 64; ++h)
    for (int w = 1; w <= 64; ++w) {
      const PyramidPlan plan{6, 1, 0};
      const OwnedFrame owned(w % 2 ? PixelFormat::I420 : PixelFormat::NV12, w, h, w * 64 + h, w % 5);
      pyramid.build(owned.frame, plan);
      expect_same(pyramid, owned.frame, plan);
      if (HasFatalFailure())
        return;
    }
}

TEST(Pyramid, EveryFormatStrideAndOddSize) {
  Pyramid pyramid;
  for (int f = 0; f < pixel_format_count; ++f)
    for (const auto& [w, h] :
         {std::pair{1, 1}, {1, 9}, {9, 1}, {2, 2}, {3, 5}, {66, 35}, {131, 77}, {256, 64}})
      for (const bool flipped : {false, true})
        for (const int padding : {0, 7}) {
          const OwnedFrame owned(static_cast<PixelFormat>(f), w, h, f + w, padding, flipped);
          const Oracle oracle(owned.frame, 6);
          for (const PyramidPlan plan : {PyramidPlan{5, 5, 2}, {3, 0, 0}, {4, 1, 1}, {0, 0, 0}, {6, 6, 6}}) {
            pyramid.build(owned.frame, plan);
            expect_same(pyramid, owned.frame, plan, oracle);
            if (HasFatalFailure())
              return;
          }
        }
}

TEST(Pyramid, LargeFrames) {
  Pyramid pyramid;
  for (const auto& [w, h] : {std::pair{3840, 2160}, {1920, 1080}, {1921, 541}, {4099, 37}})
    for (const PixelFormat format :
         {PixelFormat::NV12, PixelFormat::I420, PixelFormat::RGB, PixelFormat::P010_10LE}) {
      const OwnedFrame owned(format, w, h, w, 13);
      const PyramidPlan plan{5, 5, 2};
      pyramid.build(owned.frame, plan);
      expect_same(pyramid, owned.frame, plan);
      if (HasFatalFailure())
        return;
    }
}

TEST(Pyramid, BandsGiveTheSameBytes) {
  Pyramid pyramid;
  Workers two(2), three(3), seven(7);
  for (int f = 0; f < pixel_format_count; ++f)
    for (const auto& [w, h] : {std::pair{64, 9}, {77, 131}, {130, 513}}) {
      const OwnedFrame owned(static_cast<PixelFormat>(f), w, h, f + w, 3);
      const Oracle oracle(owned.frame, 5);
      for (Workers* workers : {&two, &three, &seven})
        for (const PyramidPlan plan : {PyramidPlan{5, 3, 2}, {3, 0, 0}, {4, 1, 1}, {0, 0, 0}, {2, 2, 2}}) {
          pyramid.build(owned.frame, plan, workers);
          expect_same(pyramid, owned.frame, plan, oracle);
          if (HasFatalFailure())
            return;
        }
    }
}

TEST(Pyramid, SparseLevelsUseEverySecondRow) {
  Pyramid pyramid;
  Workers two(2), three(3);
  for (int f = 0; f < pixel_format_count; ++f)
    for (const auto& [w, h] : {std::pair{1, 1}, {2, 5}, {9, 3}, {77, 131}, {131, 66}, {130, 513}})
      for (const bool flipped : {false, true}) {
        const OwnedFrame owned(static_cast<PixelFormat>(f), w, h, f + w, 3, flipped);
        for (PyramidPlan plan : {PyramidPlan{5, 3, 2, 1, 2},
                                 {5, 3, 2, 2, 0},
                                 {6, 4, 3, 2, 3},
                                 {4, 1, 1, 1, 1},
                                 {3, 3, 3, 3, 3}}) {
          if (layout_of(owned.frame.format).rgb)
            plan.sparse_color = plan.sparse_luma;
          const Oracle oracle(owned.frame, plan.coarsest, plan.sparse_luma, plan.sparse_color);
          for (Workers* workers : {static_cast<Workers*>(nullptr), &two, &three}) {
            pyramid.build(owned.frame, plan, workers);
            expect_same(pyramid, owned.frame, plan, oracle);
            if (HasFatalFailure())
              return;
          }
        }
      }
}

TEST(Pyramid, Level0OfAPlanarComponentIsTheFrameItself) {
  const OwnedFrame owned(PixelFormat::Y444, 33, 20, 1, 5, true);
  Pyramid pyramid;
  pyramid.build(owned.frame, {2, 0, 0});
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(pyramid.plane(0, c).data, owned.frame.planes[c].data);
    EXPECT_EQ(pyramid.plane(0, c).stride, owned.frame.planes[c].stride);
  }
}

TEST(Pyramid, ChromaOfGreyIs128OnceFormatsChange) {
  Pyramid pyramid;
  const PyramidPlan plan{4, 1, 0};
  for (const PixelFormat format : {PixelFormat::I420, PixelFormat::GRAY8, PixelFormat::GRAY16_LE,
                                   PixelFormat::Y444, PixelFormat::GRAY8}) {
    const OwnedFrame owned(format, 70, 41, 3);
    pyramid.build(owned.frame, plan);
    expect_same(pyramid, owned.frame, plan);
  }
}

} // namespace
