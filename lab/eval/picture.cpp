// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/picture.hpp"

#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <stdexcept>

#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <opencv2/imgproc.hpp>

namespace terrainseg::eval {
namespace {

template <class T, void release(T*)> struct Release {
  void operator()(T* it) const { release(it); }
};
void unref_object(GstElement* element) {
  gst_object_unref(element);
}
void unref_sample(GstSample* sample) {
  gst_sample_unref(sample);
}
void unref_buffer(GstBuffer* buffer) {
  gst_buffer_unref(buffer);
}
using ElementHandle = std::unique_ptr<GstElement, Release<GstElement, unref_object>>;
using SampleHandle = std::unique_ptr<GstSample, Release<GstSample, unref_sample>>;
using BufferHandle = std::unique_ptr<GstBuffer, Release<GstBuffer, unref_buffer>>;
using ConverterHandle =
    std::unique_ptr<GstVideoConverter, Release<GstVideoConverter, gst_video_converter_free>>;

void start_gstreamer() {
  static std::once_flag once;
  std::call_once(once, [] { gst_init(nullptr, nullptr); });
}

/// A buffer that is mapped as a picture for as long as this lives.
class Mapped {
 public:
  Mapped(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags) {
    if (!gst_video_frame_map(&frame_, const_cast<GstVideoInfo*>(&info), buffer, flags))
      throw std::runtime_error("a picture cannot be mapped");
  }
  ~Mapped() { gst_video_frame_unmap(&frame_); }
  Mapped(const Mapped&) = delete;
  Mapped& operator=(const Mapped&) = delete;
  GstVideoFrame& frame() { return frame_; }
  /// One plane of `size` pixels as a matrix over the mapped memory.
  cv::Mat plane(guint number, const cv::Size& size, int type) {
    return {size, type, GST_VIDEO_FRAME_PLANE_DATA(&frame_, number),
            static_cast<std::size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&frame_, number))};
  }

 private:
  GstVideoFrame frame_;
};

/// What the element makes of the same caps: a matrix that is not named is the usual one for the size.
Colorimetry colorimetry_of(const GstVideoInfo& info) {
  const bool large = GST_VIDEO_INFO_HEIGHT(&info) > 576;
  Colorimetry c{info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255 ? ColorRange::full
                                                                      : ColorRange::limited,
                ColorMatrix::bt601};
  if (info.colorimetry.matrix == GST_VIDEO_COLOR_MATRIX_BT2020)
    c.matrix = ColorMatrix::bt2020;
  else if (info.colorimetry.matrix == GST_VIDEO_COLOR_MATRIX_BT709 ||
           (large && info.colorimetry.matrix == GST_VIDEO_COLOR_MATRIX_UNKNOWN))
    c.matrix = ColorMatrix::bt709;
  return c;
}

GstVideoInfo info_of(GstVideoFormat format, const cv::Size& size, const Colorimetry& colorimetry) {
  GstVideoInfo info;
  if (!gst_video_info_set_format(&info, format, static_cast<guint>(size.width),
                                 static_cast<guint>(size.height)))
    throw std::runtime_error("a picture of " + std::to_string(size.width) + "x" +
                             std::to_string(size.height) + " pixels cannot be converted");
  if (format == GST_VIDEO_FORMAT_I420) {
    info.colorimetry.range =
        colorimetry.range == ColorRange::full ? GST_VIDEO_COLOR_RANGE_0_255 : GST_VIDEO_COLOR_RANGE_16_235;
    info.colorimetry.matrix = colorimetry.matrix == ColorMatrix::bt709    ? GST_VIDEO_COLOR_MATRIX_BT709
                              : colorimetry.matrix == ColorMatrix::bt2020 ? GST_VIDEO_COLOR_MATRIX_BT2020
                                                                          : GST_VIDEO_COLOR_MATRIX_BT601;
  }
  return info;
}

BufferHandle buffer_for(const GstVideoInfo& info) {
  return BufferHandle(gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info), nullptr));
}

/// The sides of plane 0, 1 or 2 of 4:2:0.
cv::Size plane_size(const cv::Size& picture, std::size_t plane) {
  return plane == 0 ? picture : cv::Size(subsampled(picture.width, 1), subsampled(picture.height, 1));
}

void convert(const GstVideoInfo& from, GstBuffer* source, const GstVideoInfo& to, GstBuffer* target) {
  const ConverterHandle converter(
      gst_video_converter_new(const_cast<GstVideoInfo*>(&from), const_cast<GstVideoInfo*>(&to), nullptr));
  if (!converter)
    throw std::runtime_error("GStreamer cannot convert between these pictures");
  Mapped in(from, source, GST_MAP_READ), out(to, target, GST_MAP_WRITE);
  gst_video_converter_frame(converter.get(), &in.frame(), &out.frame());
}

std::string take_error(GstElement* pipeline) {
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
  gst_object_unref(bus);
  if (!message)
    return "the decoder gave no picture";
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  const std::string text = error->message;
  g_error_free(error);
  gst_message_unref(message);
  // NOLINTNEXTLINE(performance-no-automatic-move)
  return text;
}

/// The first picture behind `decoder ! videoconvert`.
SampleHandle decode(const std::string& path, const std::string& decoder) {
  start_gstreamer();
  GError* error = nullptr;
  const ElementHandle pipeline(
      gst_parse_launch(("filesrc name=file ! " + decoder +
                        " ! videoconvert ! video/x-raw,format=I420 ! appsink name=out sync=false")
                           .c_str(),
                       &error));
  if (error) {
    const std::string text = error->message;
    g_error_free(error);
    throw std::runtime_error(path + ": cannot be decoded: " + text +
                             " (jpegdec and pngdec are in gst-plugins-good)");
  }
  const ElementHandle file(gst_bin_get_by_name(GST_BIN(pipeline.get()), "file")),
      out(gst_bin_get_by_name(GST_BIN(pipeline.get()), "out"));
  g_object_set(file.get(), "location", path.c_str(), nullptr);
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  SampleHandle sample(gst_app_sink_try_pull_sample(GST_APP_SINK(out.get()), 30 * GST_SECOND));
  const std::string problem = sample ? "" : take_error(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  if (!sample)
    throw std::runtime_error(path + ": not a readable picture: " + problem);
  return sample;
}

} // namespace

Picture::Picture(const cv::Size& size, const Colorimetry& colorimetry) : colorimetry_(colorimetry) {
  for (std::size_t i = 0; i < planes_.size(); ++i)
    planes_[i].create(plane_size(size, i));
}

Picture Picture::read(const std::string& path) {
  const SampleHandle sample =
      decode(path, std::filesystem::path(path).extension() == ".png" ? "pngdec" : "jpegdec");
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())))
    throw std::runtime_error(path + ": the decoder gave no picture");
  Picture picture({GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info)}, colorimetry_of(info));
  Mapped in(info, gst_sample_get_buffer(sample.get()), GST_MAP_READ);
  for (guint i = 0; i < 3; ++i)
    in.plane(i, plane_size(picture.size(), i), CV_8UC1).copyTo(picture.planes_[i]);
  return picture;
}

Picture Picture::of(const cv::Mat3b& bgr, const Colorimetry& colorimetry) {
  start_gstreamer();
  const GstVideoInfo from = info_of(GST_VIDEO_FORMAT_BGR, bgr.size(), {}),
                     to = info_of(GST_VIDEO_FORMAT_I420, bgr.size(), colorimetry);
  const BufferHandle source = buffer_for(from), target = buffer_for(to);
  bgr.copyTo(Mapped(from, source.get(), GST_MAP_WRITE).plane(0, bgr.size(), CV_8UC3));
  convert(from, source.get(), to, target.get());
  Picture picture(bgr.size(), colorimetry);
  Mapped out(to, target.get(), GST_MAP_READ);
  for (guint i = 0; i < 3; ++i)
    out.plane(i, plane_size(bgr.size(), i), CV_8UC1).copyTo(picture.planes_[i]);
  return picture;
}

Picture Picture::resized(const cv::Size& size) const {
  if (size == this->size())
    return *this;
  cv::Mat3b scaled;
  cv::resize(bgr(), scaled, size, 0, 0, cv::INTER_AREA);
  return of(scaled, colorimetry_);
}

cv::Mat3b Picture::bgr() const {
  start_gstreamer();
  const GstVideoInfo from = info_of(GST_VIDEO_FORMAT_I420, size(), colorimetry_),
                     to = info_of(GST_VIDEO_FORMAT_BGR, size(), {});
  const BufferHandle source = buffer_for(from), target = buffer_for(to);
  {
    Mapped in(from, source.get(), GST_MAP_WRITE);
    for (guint i = 0; i < 3; ++i)
      planes_[i].copyTo(in.plane(i, plane_size(size(), i), CV_8UC1));
  }
  convert(from, source.get(), to, target.get());
  return Mapped(to, target.get(), GST_MAP_READ).plane(0, size(), CV_8UC3).clone();
}

Frame Picture::frame() const {
  Frame frame;
  frame.width = size().width;
  frame.height = size().height;
  frame.colorimetry = colorimetry_;
  frame.vanishing_row = vanishing_row_;
  for (std::size_t i = 0; i < planes_.size(); ++i)
    frame.planes[i] = {planes_[i].data, static_cast<std::ptrdiff_t>(planes_[i].step)};
  return frame;
}

MutableFrame Picture::mutable_frame() {
  MutableFrame frame;
  frame.width = size().width;
  frame.height = size().height;
  frame.colorimetry = colorimetry_;
  for (std::size_t i = 0; i < planes_.size(); ++i)
    frame.planes[i] = {planes_[i].data, static_cast<std::ptrdiff_t>(planes_[i].step)};
  return frame;
}

} // namespace terrainseg::eval
