// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/engines.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <ostream>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/tuning.hpp"
#include "lab/eval/statistics.hpp"
#include "lab/eval/written_masks.hpp"
#include "lab/reference/reference_engine.hpp"
#include "terrainseg/segmenter.hpp"
#include "terrainseg/settings_table.hpp"

namespace terrainseg::eval {

const char* const engine_help =
    "  default | paper[,SETTING=VALUE...]   the filter in a preset; settings are the properties of "
    "terrainseg;\n"
    "                                       input=BGR uses B G R instead of I420,\n"
    "                                       pose=true sends the pose (rendered places only),\n"
    "                                       tuning.NAME=VALUE changes a tuned constant\n"
    "  reference                            the unmodified algorithm: full resolution, full covariances, "
    "doubles\n"
    "  rows[:R] | ramp | mean-mask          baselines that ignore the image: everything below the row R x "
    "height\n"
    "                                       (without R the best row), the best ramp, the mean of the other "
    "frames' labels\n"
    "  masks:FOLDER                         masks of another program: PNG files named as the labels, in\n"
    "                                       FOLDER/SEQUENCE if that exists, else in FOLDER\n";

namespace {

/// Of an engine's words those that are no settings: frames are shown as B G R, with what a pose tells.
constexpr const char* input_bgr = "input=BGR";
constexpr const char* with_pose = "pose=true";
constexpr std::string_view tuning_mark = "tuning.";

std::vector<std::string> split(const std::string& text, char mark) {
  std::vector<std::string> parts;
  std::size_t start = 0;
  for (std::size_t end = 0; end != std::string::npos; start = end + 1) {
    end = text.find(mark, start);
    parts.push_back(text.substr(start, end == std::string::npos ? end : end - start));
  }
  return parts;
}

class Filter : public Engine {
 public:
  Filter(const Settings& settings, double fps, PixelFormat input, bool posed)
      : settings_(settings), segmenter_(settings), fps_(fps), input_(input), posed_(posed) {}

  using Engine::look;
  Answer look(const Picture& picture, std::size_t, const cv::Mat1b& training) override {
    Frame frame = picture.frame();
    if (!posed_)
      frame.vanishing_row.reset();
    cv::Mat3b bgr;
    if (input_ == PixelFormat::BGR) {
      bgr = picture.bgr();
      frame.format = PixelFormat::BGR;
      frame.colorimetry = {ColorRange::full, ColorMatrix::bt601};
      frame.planes[0] = {bgr.data, static_cast<std::ptrdiff_t>(bgr.step)};
    }
    frame.pts = fps_ > 0 ? static_cast<std::int64_t>(static_cast<double>(shown_++) * 1e9 / fps_) : -1;
    Answer answer;
    Supervision supervision;
    if (!training.empty())
      supervision.mask = {
          {training.data, static_cast<std::ptrdiff_t>(training.step)}, training.cols, training.rows};
    const double start = processor_milliseconds();
    const Status status = segmenter_.process(frame, supervision);
    answer.milliseconds = processor_milliseconds() - start;
    if (!status.ok())
      throw std::runtime_error(status.message());
    const Estimate& e = segmenter_.estimate();
    const cv::Mat view(e.mask.height, e.mask.width, CV_8UC1, const_cast<std::uint8_t*>(e.mask.plane.data),
                       static_cast<std::size_t>(e.mask.plane.stride));
    cv::resize(view, answer.mask, picture.size(), 0, 0, cv::INTER_NEAREST);
    answer.knows_horizon = true;
    if (e.horizon_row >= 0 && !(e.flags & flag_horizon_held)) // what the frame itself shows
      answer.horizon = static_cast<double>(e.horizon_row) / picture.size().height;
    answer.confidence = e.confidence;
    if (const GrayView& map = e.confidence_map; !map.empty())
      answer.confidence_map = cv::Mat1b(map.height, map.width, const_cast<std::uint8_t*>(map.plane.data),
                                        static_cast<std::size_t>(map.plane.stride))
                                  .clone();
    return answer;
  }
  void forget() override {
    segmenter_ = Segmenter(settings_);
    shown_ = 0;
  }

 private:
  Settings settings_;
  Segmenter segmenter_;
  double fps_;
  PixelFormat input_;
  bool posed_;
  std::int64_t shown_ = 0;
};

class Unmodified : public Engine {
 public:
  explicit Unmodified(int window_bottom) : engine_(settings_of(window_bottom)) {}
  using Engine::look;
  Answer look(const Picture& picture, std::size_t, const cv::Mat1b& training) override {
    Answer answer;
    const cv::Mat3b bgr = picture.bgr();
    const double start = processor_milliseconds();
    const reference::ReferenceResult& result = engine_.process(bgr, training);
    answer.milliseconds = processor_milliseconds() - start;
    answer.mask = result.mask.clone();
    return answer;
  }
  void forget() override { engine_.reset(); }

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
  using Engine::look;
  Answer look(const Picture& picture, std::size_t, const cv::Mat1b&) override {
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
  using Engine::look;
  Answer look(const Picture& picture, std::size_t index, const cv::Mat1b&) override {
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

Settings filter_settings(const std::string& text, int window_bottom) {
  const std::vector<std::string> parts = split(text, ',');
  Settings settings = Settings::of(parts[0] == "paper" ? Preset::paper : Preset::standard);
  settings.window_bottom = window_bottom;
  std::vector<const Setting*> changed;
  for (std::size_t i = 1; i < parts.size(); ++i) {
    if (parts[i] == input_bgr || parts[i] == with_pose || parts[i].starts_with(tuning_mark))
      continue;
    const std::size_t mark = std::min(parts[i].find('='), parts[i].size());
    const std::string setting = parts[i].substr(0, mark),
                      value = parts[i].substr(std::min(mark + 1, parts[i].size()));
    if (const auto error = set_from_text(settings, setting, value))
      throw std::runtime_error(error->message());
    changed.push_back(find_setting(setting)); // none: regions, which both pipelines use
  }
  if (const auto error = validate(settings))
    throw std::runtime_error(text + ": " + error->message());
  for (const Setting* setting : changed)
    if (setting && is_idle(*setting, settings))
      throw std::runtime_error(text + ": " + setting->name + " has " +
                               (setting->used_by == UsedBy::none ? "no effect: the stage was removed"
                                : settings.free_space            ? "an effect with free-space=false only"
                                                                 : "no effect with free-space=false"));
  return settings;
}

void tune(const std::string& text) {
  tuning::reset();
  for (const std::string& part : split(text, ',')) {
    if (!part.starts_with(tuning_mark))
      continue;
    const std::size_t mark = std::min(part.find('='), part.size());
    const std::string name = part.substr(tuning_mark.size(), mark - tuning_mark.size()),
                      value = part.substr(std::min(mark + 1, part.size()));
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (error != std::errc() || end != value.data() + value.size())
      throw std::runtime_error(part + ": not a whole number");
    if (!tuning::set(name, number))
      throw std::runtime_error(part + ": no such constant; terrainseg-eval tuning lists them");
  }
}

void list_tuning(std::ostream& out) {
  std::vector<std::pair<std::string, std::int64_t>> lines;
  for (const tuning::Knob& knob : tuning::knobs())
    lines.emplace_back(knob.name, knob.standard);
  std::sort(lines.begin(), lines.end());
  for (const auto& [name, value] : lines)
    out << name << ' ' << value << '\n';
}

std::unique_ptr<Engine> make_filter(const Settings& settings, double fps, PixelFormat input, bool posed) {
  if (const auto error = validate(settings))
    throw std::runtime_error(error->message());
  return std::make_unique<Filter>(settings, fps, input, posed);
}

std::unique_ptr<Engine> make_reference(int window_bottom) {
  return std::make_unique<Unmodified>(window_bottom);
}

std::unique_ptr<Engine> make_engine(const std::string& text, const Sequence& sequence,
                                    const std::vector<cv::Mat1b>& labels) {
  const std::vector<std::string> parts = split(text, ',');
  const std::string& name = parts[0];
  if (name == "default" || name == "paper") {
    const auto has = [&](const char* word) {
      return std::find(parts.begin(), parts.end(), word) != parts.end();
    };
    return make_filter(filter_settings(text, sequence.window_bottom), sequence.fps,
                       has(input_bgr) ? PixelFormat::BGR : PixelFormat::I420,
                       has(with_pose) || !sequence.horizon.empty());
  }
  if (parts.size() > 1)
    throw std::runtime_error(text + ": only default and paper take settings");
  if (name == "reference")
    return make_reference(sequence.window_bottom);
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
