// SPDX-License-Identifier: LGPL-2.1-or-later
// The filter without GStreamer: pictures in on stdin, masks out on stdout.
//
// c++ -std=c++20 core_only.cpp -o core_only $(pkg-config --cflags --libs terrainseg)
// core_only < pictures.ppm > masks.pgm              PPM (P6), one behind the other
// core_only 640x360 [FPS] < video.i420 > masks.pgm  raw I420 frames of this size (30 a second)
//
// Masks are PGM (P5), one behind the other: 0 not traversable, 128 doubtful, 255 traversable. A line per
// frame on stderr.
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include <terrainseg/segmenter.hpp>

namespace {

/// The next number of a PPM header, past blanks and comments.
std::optional<int> header_number(std::FILE* file) {
  int c = std::fgetc(file);
  while (c == ' ' || c == '\n' || c == '\r' || c == '\t' || c == '#') {
    if (c == '#')
      while (c != '\n' && c != EOF)
        c = std::fgetc(file);
    c = std::fgetc(file);
  }
  if (c < '0' || c > '9')
    return std::nullopt;
  int value = 0;
  for (; c >= '0' && c <= '9' && value < 100'000; c = std::fgetc(file))
    value = 10 * value + (c - '0');
  return value; // the one character behind the number is taken too, as the format wants
}

enum class Read { frame, end, error };

/// A picture that owns its bytes.
struct Picture {
  std::vector<std::uint8_t> bytes;
  terrainseg::Frame frame;
};

Read fill(Picture& picture, std::size_t size) {
  picture.bytes.resize(size);
  const std::size_t count = std::fread(picture.bytes.data(), 1, size, stdin);
  return count == size ? Read::frame : count == 0 ? Read::end : Read::error;
}

Read read_ppm(Picture& picture) {
  const int first = std::fgetc(stdin);
  if (first == EOF)
    return Read::end;
  if (first != 'P' || std::fgetc(stdin) != '6')
    return Read::error;
  const auto width = header_number(stdin), height = header_number(stdin), depth = header_number(stdin);
  if (!width || !height || depth != 255 || *width < 1 || *height < 1 || *width > 32767 || *height > 32767)
    return Read::error;
  if (fill(picture, static_cast<std::size_t>(*width) * *height * 3) != Read::frame)
    return Read::error;
  picture.frame.format = terrainseg::PixelFormat::RGB;
  picture.frame.width = *width;
  picture.frame.height = *height;
  picture.frame.colorimetry.range = terrainseg::ColorRange::full;
  picture.frame.planes[0] = {picture.bytes.data(), *width * 3};
  return Read::frame;
}

Read read_i420(Picture& picture, int width, int height) {
  using terrainseg::subsampled;
  const int half_width = subsampled(width, 1), half_height = subsampled(height, 1);
  const std::size_t luma = static_cast<std::size_t>(width) * height;
  const std::size_t chroma = static_cast<std::size_t>(half_width) * half_height;
  const Read result = fill(picture, luma + 2 * chroma);
  picture.frame.format = terrainseg::PixelFormat::I420;
  picture.frame.width = width;
  picture.frame.height = height;
  const std::uint8_t* data = picture.bytes.data();
  picture.frame.planes = {{{data, width}, {data + luma, half_width}, {data + luma + chroma, half_width}}};
  return result;
}

bool write_pgm(const terrainseg::GrayView& mask) {
  std::printf("P5\n%d %d\n255\n", mask.width, mask.height);
  for (int y = 0; y < mask.height; ++y)
    std::fwrite(mask.plane.row(y), 1, static_cast<std::size_t>(mask.width), stdout);
  return std::ferror(stdout) == 0;
}

} // namespace

int main(int argc, char** argv) {
  int width = 0, height = 0, fps = 30;
  char end = 0;
  const bool sized = argc < 2 || (std::sscanf(argv[1], "%dx%d%c", &width, &height, &end) == 2 && width >= 1 &&
                                  height >= 1 && width <= 32767 && height <= 32767);
  const bool timed = argc < 3 || (std::sscanf(argv[2], "%d%c", &fps, &end) == 1 && fps >= 1);
  if (argc > 3 || !sized || !timed) {
    std::fprintf(stderr, "usage: core_only [WIDTHxHEIGHT [FPS]] < pictures > masks\n");
    return 2;
  }

  terrainseg::Settings settings;
  settings.caution = 2; // a little on the safe side; see terrainseg/settings.hpp for all of them
  if (const auto error = terrainseg::validate(settings)) {
    std::fprintf(stderr, "core_only: %s\n", error->message().c_str());
    return 2;
  }
  terrainseg::Segmenter segmenter(settings);

  Picture picture;
  for (std::int64_t number = 0;; ++number) {
    const Read read = width ? read_i420(picture, width, height) : read_ppm(picture);
    if (read == Read::end)
      return 0;
    if (read == Read::error) {
      std::fprintf(stderr, "core_only: the input is truncated or not a picture of the expected format\n");
      return 1;
    }
    picture.frame.pts = number * 1'000'000'000 / fps; // after a gap of 2 s the averaging of scores restarts
    if (const auto status = segmenter.process(picture.frame); !status.ok()) {
      std::fprintf(stderr, "core_only: %s\n", status.message().c_str());
      return 1;
    }
    const terrainseg::Estimate& estimate = segmenter.estimate();
    std::fprintf(stderr, "frame %llu: %d permille traversable, horizon %d\n",
                 static_cast<unsigned long long>(estimate.frame), estimate.traversable_permille,
                 estimate.horizon_row);
    if (!write_pgm(estimate.mask)) {
      std::fprintf(stderr, "core_only: cannot write the mask\n");
      return 1;
    }
  }
}
