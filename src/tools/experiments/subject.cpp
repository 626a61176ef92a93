// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/experiments/subject.hpp"

#include <algorithm>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

namespace terrainseg::experiments {

namespace {

class FilterSubject : public Subject {
 public:
  FilterSubject(const Settings& settings, Input input, double fps)
      : segmenter_(settings), input_(input), frame_time_(fps > 0 ? 1e9 / fps : 0) {}

  cv::Mat label(const Shot& shot, const cv::Mat& training) override {
    Frame frame = picture_.set(shot.picture, input_);
    if (frame_time_ > 0)
      frame.pts = static_cast<std::int64_t>(frame_time_ * static_cast<double>(count_++));
    Supervision supervision;
    if (!training.empty())
      supervision.mask = {
          {training.data, static_cast<std::ptrdiff_t>(training.step)}, training.cols, training.rows};
    if (const Status status = segmenter_.process(frame, supervision); !status.ok())
      throw std::runtime_error(status.message());
    const GrayView& mask = segmenter_.estimate().mask;
    return cv::Mat(mask.height, mask.width, CV_8UC1, const_cast<std::uint8_t*>(mask.plane.data),
                   static_cast<std::size_t>(mask.plane.stride));
  }
  int horizon_row() const override { return segmenter_.estimate().horizon_row; }

 private:
  Segmenter segmenter_;
  Input input_;
  double frame_time_;
  std::int64_t count_ = 0;
  FramePicture picture_;
};

class ReferenceSubject : public Subject {
 public:
  explicit ReferenceSubject(const reference::ReferenceSettings& settings) : engine_(settings) {}
  cv::Mat label(const Shot& shot, const cv::Mat& training) override {
    return engine_.process(shot.picture, training).mask;
  }

 private:
  reference::ReferenceEngine engine_;
};

class ReadingSubject : public Subject {
 public:
  explicit ReadingSubject(const reference::Readings& readings) : reading_(readings) {}
  cv::Mat label(const Shot& shot, const cv::Mat&) override { return reading_.process(shot.picture); }
  int horizon_row() const override { return reading_.horizon_row(); }

 private:
  reference::PaperReading reading_;
};

class RowSubject : public Subject {
 public:
  explicit RowSubject(double row) : row_(row) {}
  cv::Mat label(const Shot& shot, const cv::Mat&) override {
    mask_ = cv::Mat::zeros(shot.picture.size(), CV_8UC1);
    mask_.rowRange(std::min(static_cast<int>(row_ * mask_.rows + 0.999), mask_.rows), mask_.rows).setTo(255);
    return mask_;
  }

 private:
  double row_;
  cv::Mat mask_;
};

} // namespace

std::unique_ptr<Subject> filter_subject(const Settings& settings, Input input, double fps) {
  if (const auto error = validate(settings))
    throw std::runtime_error(error->message());
  return std::make_unique<FilterSubject>(settings, input, fps);
}

std::unique_ptr<Subject> reference_subject(const reference::ReferenceSettings& settings) {
  return std::make_unique<ReferenceSubject>(settings);
}

std::unique_ptr<Subject> reading_subject(const reference::Readings& readings) {
  return std::make_unique<ReadingSubject>(readings);
}

std::unique_ptr<Subject> row_subject(double row) {
  return std::make_unique<RowSubject>(row);
}

const Frame& FramePicture::set(const cv::Mat& bgr, Input input) {
  frame_.width = bgr.cols;
  frame_.height = bgr.rows;
  if (input == Input::bgr) {
    bgr_ = bgr;
    frame_.format = PixelFormat::BGR;
    frame_.colorimetry.range = ColorRange::full;
    frame_.planes[0] = {bgr_.data, static_cast<std::ptrdiff_t>(bgr_.step)};
    return frame_;
  }
  if (bgr.cols % 2 != 0 || bgr.rows % 2 != 0)
    throw std::runtime_error("pictures of odd width or height cannot become 4:2:0 here");
  cv::cvtColor(bgr, i420_, cv::COLOR_BGR2YUV_I420);
  frame_.format = PixelFormat::I420;
  frame_.colorimetry = {};
  const std::uint8_t* luma = i420_.data;
  const int half = bgr.cols / 2;
  const std::uint8_t* u = luma + bgr.total();
  const std::uint8_t* v = u + bgr.total() / 4;
  frame_.planes = {Plane{luma, bgr.cols}, Plane{u, half}, Plane{v, half}};
  return frame_;
}

void Score::add(const cv::Mat& mask, const cv::Mat& labels) {
  if (mask.size() != labels.size())
    throw std::runtime_error("a mask and its labels differ in size");
  const cv::Mat ground = (labels == 1) | (labels == 2), is_known = labels != 255, said = mask == 255;
  wrong += cv::countNonZero((ground != said) & is_known);
  known += cv::countNonZero(is_known);
  cv::Mat obstacles = is_known & ~ground;
  obstacles.rowRange(0, 2 * labels.rows / 3).setTo(0);
  unsafe += cv::countNonZero(obstacles & said);
  near_obstacles += cv::countNonZero(obstacles);
}

int true_horizon(const cv::Mat& labels) {
  const cv::Mat ground = (labels == 1) | (labels == 2);
  for (int y = 0; y < ground.rows; ++y)
    if (cv::countNonZero(ground.row(y)) >= 0.02 * ground.cols)
      return y;
  return -1;
}

} // namespace terrainseg::experiments
