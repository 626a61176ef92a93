// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/eval/engines.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "reference/reference_engine.hpp"
#include "terrainseg/segmenter.hpp"
#include "tools/eval/written_masks.hpp"

namespace terrainseg::eval {

const char* const engine_help =
    "  default | paper[,SETTING=VALUE...]   the filter in a preset; settings are the properties of "
    "terrainseg\n"
    "  reference                            the unmodified algorithm: full resolution, full covariances, "
    "doubles\n"
    "  rows[:R] | ramp | mean-mask          baselines that know the place only: everything below the row R x "
    "height\n"
    "                                       (without R the best row), the best ramp, the mean of the other "
    "frames' labels\n"
    "  masks:FOLDER                         masks written by something else, PNG named as the labels, in\n"
    "                                       FOLDER or, where there is one, in FOLDER/SEQUENCE\n";

namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

std::vector<std::string> split(const std::string& text, char mark) {
  std::vector<std::string> parts;
  std::size_t start = 0;
  for (std::size_t end = 0; end != std::string::npos; start = end + 1) {
    end = text.find(mark, start);
    parts.push_back(text.substr(start, end == std::string::npos ? end : end - start));
  }
  return parts;
}

int whole_number(const std::string& name, const std::string& value) {
  int number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc{} || end != value.data() + value.size())
    throw std::runtime_error(name + " = " + value + ": not a whole number");
  return number;
}

void apply(Settings& settings, const std::string& assignment) {
  const std::size_t mark = assignment.find('=');
  const std::string name = assignment.substr(0, mark),
                    value = mark == std::string::npos ? "" : assignment.substr(mark + 1);
  const std::map<std::string, bool Settings::*> switches{{"texture", &Settings::texture},
                                                         {"exposure", &Settings::exposure},
                                                         {"row-prior", &Settings::row_prior},
                                                         {"local-reference", &Settings::local_reference},
                                                         {"geodesic", &Settings::geodesic},
                                                         {"second-look", &Settings::second_look},
                                                         {"ground-behind", &Settings::ground_behind},
                                                         {"free-space", &Settings::free_space},
                                                         {"refine", &Settings::refine},
                                                         {"learning", &Settings::learning},
                                                         {"near-clear", &Settings::near_clear}};
  const std::map<std::string, int Settings::*> numbers{{"window-width", &Settings::window_width},
                                                       {"window-height", &Settings::window_height},
                                                       {"window-bottom", &Settings::window_bottom},
                                                       {"window-x", &Settings::window_x},
                                                       {"pyramid-levels", &Settings::pyramid_levels},
                                                       {"bit-shift", &Settings::bit_shift},
                                                       {"training-models", &Settings::training_models},
                                                       {"learned-models", &Settings::learned_models},
                                                       {"mass-cap", &Settings::mass_cap},
                                                       {"forget-shift", &Settings::forget_shift},
                                                       {"caution", &Settings::caution},
                                                       {"doubtful", &Settings::doubtful},
                                                       {"mask-level", &Settings::mask_level},
                                                       {"n-threads", &Settings::n_threads}};
  const std::map<std::string, int Settings::*> in_q8{{"window-sigma", &Settings::window_sigma_q8},
                                                     {"match-threshold", &Settings::match_threshold_q8},
                                                     {"threshold", &Settings::threshold_q8}};
  const auto choice = [&](std::initializer_list<const char*> words) {
    int i = 0;
    std::string all;
    for (const char* word : words) {
      if (value == word)
        return i;
      all += std::string(i++ ? ", " : "") + word;
    }
    throw std::runtime_error(name + " = " + value + ": not one of " + all);
  };
  if (const auto it = switches.find(name); it != switches.end())
    settings.*it->second = choice({"false", "true"}) == 1;
  else if (const auto number = numbers.find(name); number != numbers.end())
    settings.*number->second = whole_number(name, value);
  else if (const auto scaled = in_q8.find(name); scaled != in_q8.end())
    try {
      settings.*scaled->second = static_cast<int>(std::stod(value) * 256);
    } catch (const std::exception&) {
      throw std::runtime_error(name + " = " + value + ": not a number");
    }
  else if (name == "horizon")
    settings.horizon = static_cast<HorizonMode>(choice({"off", "paper", "auto"}));
  else if (name == "negatives")
    settings.negatives = static_cast<Negatives>(choice({"off", "rest", "split"}));
  else if (name == "temporal")
    settings.temporal = static_cast<Temporal>(choice({"auto", "off", "on"}));
  else
    throw std::runtime_error(name + ": no such setting");
}

/// A picture as the I420 frame that GStreamer's decoders and videoconvert make of it: BT.601, full range from
/// JPEG, limited from anything else.
class I420Picture {
 public:
  explicit I420Picture(ColorRange range) { frame_.colorimetry = {range, ColorMatrix::bt601}; }
  const Frame& convert(const cv::Mat3b& bgr) {
    const int width = bgr.cols, height = bgr.rows;
    const bool limited = frame_.colorimetry.range == ColorRange::limited;
    const double luma = limited ? 219.0 / 255 : 1, chroma = limited ? 224.0 / 255 : 1;
    const cv::Matx34d matrix(0.114 * luma, 0.587 * luma, 0.299 * luma, limited ? 16 : 0, //
                             0.5 * chroma, -0.331264 * chroma, -0.168736 * chroma, 128, -0.081312 * chroma,
                             -0.418688 * chroma, 0.5 * chroma, 128);
    cv::Mat3b yuv, small;
    cv::transform(bgr, yuv, matrix);
    cv::resize(yuv, small, {subsampled(width, 1), subsampled(height, 1)}, 0, 0, cv::INTER_AREA);
    cv::extractChannel(yuv, planes_[0], 0);
    cv::extractChannel(small, planes_[1], 1);
    cv::extractChannel(small, planes_[2], 2);
    frame_.width = width;
    frame_.height = height;
    for (std::size_t c = 0; c < 3; ++c)
      frame_.planes[c] = {planes_[c].data, static_cast<std::ptrdiff_t>(planes_[c].step)};
    return frame_;
  }
  Frame& frame() { return frame_; }

 private:
  std::array<cv::Mat1b, 3> planes_;
  Frame frame_;
};

class Filter : public Engine {
 public:
  Filter(const Settings& settings, double fps, ColorRange range)
      : segmenter_(settings), fps_(fps), picture_(range) {}

  Answer look(const cv::Mat3b& picture, std::size_t index) override {
    picture_.convert(picture);
    picture_.frame().pts = fps_ > 0 ? static_cast<std::int64_t>(static_cast<double>(index) * 1e9 / fps_) : -1;
    Answer answer;
    const auto start = Clock::now();
    const Status status = segmenter_.process(picture_.frame());
    answer.milliseconds = milliseconds_since(start);
    if (!status.ok())
      throw std::runtime_error(status.message());
    const Estimate& e = segmenter_.estimate();
    const cv::Mat view(e.mask.height, e.mask.width, CV_8UC1, const_cast<std::uint8_t*>(e.mask.plane.data),
                       static_cast<std::size_t>(e.mask.plane.stride));
    cv::resize(view, answer.mask, picture.size(), 0, 0, cv::INTER_NEAREST);
    answer.knows_horizon = true;
    if (e.horizon_row >= 0)
      answer.horizon = static_cast<double>(e.horizon_row) / picture.rows;
    answer.confidence = e.confidence;
    return answer;
  }

 private:
  Segmenter segmenter_;
  double fps_;
  I420Picture picture_;
};

class Unmodified : public Engine {
 public:
  explicit Unmodified(int window_bottom) : engine_(settings_of(window_bottom)) {}
  Answer look(const cv::Mat3b& picture, std::size_t) override {
    Answer answer;
    const auto start = Clock::now();
    const reference::ReferenceResult& result = engine_.process(picture);
    answer.milliseconds = milliseconds_since(start);
    answer.mask = result.mask.clone();
    return answer;
  }

 private:
  static reference::ReferenceSettings settings_of(int window_bottom) {
    reference::ReferenceSettings settings;
    settings.window.bottom = window_bottom;
    return settings;
  }
  reference::ReferenceEngine engine_;
};

/// A mask that depends on the place alone.
class Fixed : public Engine {
 public:
  explicit Fixed(cv::Mat1b mask) : mask_(std::move(mask)) {}
  Answer look(const cv::Mat3b& picture, std::size_t) override {
    Answer answer;
    cv::resize(mask_, answer.mask, picture.size(), 0, 0, cv::INTER_NEAREST);
    return answer;
  }

 private:
  cv::Mat1b mask_;
};

/// Per pixel, how often it is ground minus how often it is something else, over all labels.
cv::Mat1i balance_of(const std::vector<cv::Mat1b>& labels) {
  cv::Mat1i balance(labels.at(0).size(), 0);
  for (const cv::Mat1b& l : labels) {
    cv::Mat1b fitting = l;
    if (l.size() != balance.size())
      cv::resize(l, fitting, balance.size(), 0, 0, cv::INTER_NEAREST);
    cv::add(balance, 1, balance, (fitting == label_terrain) | (fitting == label_ground));
    cv::subtract(balance, 1, balance, (fitting == label_obstacle) | (fitting == label_sky));
  }
  return balance;
}

/// Below a row at the middle that falls off to both sides by `slope` rows a column.
cv::Mat1b ramp(const cv::Size& size, double row, double slope) {
  cv::Mat1b mask(size, std::uint8_t{0});
  for (int x = 0; x < size.width; ++x) {
    const double top = row * size.height + slope * std::abs(x - size.width / 2.0);
    const int first = std::clamp(static_cast<int>(std::ceil(top)), 0, size.height);
    if (first < size.height)
      mask(cv::Rect(x, first, 1, size.height - first)) = 255;
  }
  return mask;
}

cv::Mat1b best_ramp(const std::vector<cv::Mat1b>& labels, bool sloped) {
  const cv::Mat1i balance = balance_of(labels);
  cv::Mat1b best;
  double most = -1e18;
  for (int row = 20; row <= 90; ++row)
    // The published baselines were found with these steps.
    // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter)
    for (double slope = 0; slope <= (sloped ? 0.8 : 0.0); slope += 0.05) {
      const cv::Mat1b mask = ramp(balance.size(), row / 100.0, slope);
      cv::Mat1i chosen(balance.size(), 0);
      balance.copyTo(chosen, mask);
      if (const double gain = cv::sum(chosen)[0]; gain > most) {
        most = gain;
        best = mask;
      }
    }
  return best;
}

/// The mean of all other frames' labels.
class MeanMask : public Engine {
 public:
  explicit MeanMask(const std::vector<cv::Mat1b>& labels) : labels_(labels), balance_(balance_of(labels)) {}
  Answer look(const cv::Mat3b& picture, std::size_t index) override {
    cv::Mat1b own = labels_.at(index);
    if (own.size() != balance_.size())
      cv::resize(own, own, balance_.size(), 0, 0, cv::INTER_NEAREST);
    cv::Mat1i others = balance_.clone();
    cv::subtract(others, 1, others, (own == label_terrain) | (own == label_ground));
    cv::add(others, 1, others, (own == label_obstacle) | (own == label_sky));
    Answer answer;
    cv::resize(cv::Mat1b(others > 0), answer.mask, picture.size(), 0, 0, cv::INTER_NEAREST);
    return answer;
  }

 private:
  const std::vector<cv::Mat1b>& labels_;
  cv::Mat1i balance_;
};

} // namespace

std::unique_ptr<Engine> make_engine(const std::string& text, const Sequence& sequence,
                                    const std::vector<cv::Mat1b>& labels) {
  const std::vector<std::string> parts = split(text, ',');
  const std::string& name = parts[0];
  if (name == "default" || name == "paper") {
    Settings settings = Settings::of(name == "paper" ? Preset::paper : Preset::standard);
    settings.window_bottom = sequence.window_bottom;
    for (std::size_t i = 1; i < parts.size(); ++i)
      apply(settings, parts[i]);
    if (const auto error = validate(settings))
      throw std::runtime_error(text + ": " + error->message());
    const bool from_jpeg = !sequence.frames.empty() && !sequence.frames[0].ends_with(".png");
    return std::make_unique<Filter>(settings, sequence.fps,
                                    from_jpeg ? ColorRange::full : ColorRange::limited);
  }
  if (parts.size() > 1)
    throw std::runtime_error(text + ": only default and paper take settings");
  if (name == "reference")
    return std::make_unique<Unmodified>(sequence.window_bottom);
  if (name == "mean-mask")
    return std::make_unique<MeanMask>(labels);
  if (name == "rows" || name == "ramp")
    return std::make_unique<Fixed>(best_ramp(labels, name == "ramp"));
  if (name.starts_with("rows:"))
    try {
      return std::make_unique<Fixed>(ramp(labels.at(0).size(), std::stod(name.substr(5)), 0));
    } catch (const std::invalid_argument&) {
      throw std::runtime_error(name + ": not a share of the height");
    }
  if (name.starts_with("masks:"))
    return written_masks(name.substr(6), sequence);
  throw std::runtime_error(text + ": no such engine; there are\n" + engine_help);
}

} // namespace terrainseg::eval
