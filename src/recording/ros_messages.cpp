// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/ros_messages.hpp"

#include "recording/cdr.hpp"
#include "recording/message_parts.hpp"

namespace terrainseg::recording {
namespace {

void put_time(CdrWriter& out, std::uint64_t time) {
  out.i32(static_cast<std::int32_t>(time / second));
  out.u32(static_cast<std::uint32_t>(time % second));
}

void put_header(CdrWriter& out, const Header& header) {
  put_time(out, header.time);
  out.string(header.frame);
}

template <class Values> void put_reals(CdrWriter& out, const Values& values) {
  for (const double value : values)
    out.f64(value);
}

/// The name of a lens model in ROS and the number of its coefficients.
std::pair<const char*, std::size_t> lens_of(const metric::Camera& camera) {
  if (camera.distortion == metric::Distortion::equidistant)
    return {"equidistant", 4};
  const auto& k = camera.coefficients;
  return k[5] != 0 || k[6] != 0 || k[7] != 0 ? std::pair{"rational_polynomial", std::size_t{8}}
                                             : std::pair{"plumb_bob", std::size_t{5}};
}

} // namespace

MessageType laser_scan_type() {
  return {"sensor_msgs/msg/LaserScan",
          schema("std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n"
                 "float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n"
                 "float32[] ranges\nfloat32[] intensities\n",
                 {header_type, time_type})};
}

MessageType point_cloud_type() {
  return {"sensor_msgs/msg/PointCloud2",
          schema("std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
                 "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
                 {header_type,
                  time_type,
                  {"sensor_msgs/PointField",
                   "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\n"
                   "uint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\n"
                   "string name\nuint32 offset\nuint8 datatype\nuint32 count\n"}})};
}

MessageType occupancy_grid_type() {
  return {"nav_msgs/msg/OccupancyGrid",
          schema("std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n",
                 {header_type,
                  time_type,
                  {"nav_msgs/MapMetaData", "builtin_interfaces/Time map_load_time\nfloat32 resolution\n"
                                           "uint32 width\nuint32 height\ngeometry_msgs/Pose origin\n"},
                  pose_type,
                  point_type,
                  quaternion_type})};
}

MessageType camera_info_type() {
  return {"sensor_msgs/msg/CameraInfo",
          schema("std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
                 "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
                 "sensor_msgs/RegionOfInterest roi\n",
                 {header_type,
                  time_type,
                  {"sensor_msgs/RegionOfInterest",
                   "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"}})};
}

MessageType image_type() {
  return {"sensor_msgs/msg/Image",
          schema("std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
                 "uint32 step\nuint8[] data\n",
                 {header_type, time_type})};
}

MessageType compressed_video_type() {
  return {"foxglove_msgs/msg/CompressedVideo",
          schema("builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n",
                 {time_type})};
}

MessageType compressed_image_type() {
  return {"sensor_msgs/msg/CompressedImage",
          schema("std_msgs/Header header\nstring format\nuint8[] data\n", {header_type, time_type})};
}

MessageType diagnostic_array_type() {
  return {"diagnostic_msgs/msg/DiagnosticArray",
          schema("std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
                 {header_type,
                  time_type,
                  {"diagnostic_msgs/DiagnosticStatus",
                   "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n"
                   "string message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"},
                  {"diagnostic_msgs/KeyValue", "string key\nstring value\n"}})};
}

MessageType tf_message_type() {
  return {"tf2_msgs/msg/TFMessage",
          schema("geometry_msgs/TransformStamped[] transforms\n",
                 {{"geometry_msgs/TransformStamped",
                   "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
                  header_type,
                  time_type,
                  {"geometry_msgs/Transform",
                   "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
                  vector_type,
                  quaternion_type})};
}

void encode(Bytes& bytes, const Header& header, const LaserScan& scan) {
  CdrWriter out(bytes);
  put_header(out, header);
  const double steps = scan.ranges.empty() ? 0 : static_cast<double>(scan.ranges.size() - 1);
  for (const double value : {scan.angle_min, scan.angle_min + steps * scan.angle_increment,
                             scan.angle_increment, 0.0, scan.scan_time, scan.range_min, scan.range_max})
    out.f32(static_cast<float>(value));
  out.count(scan.ranges.size());
  for (const float range : scan.ranges)
    out.f32(range);
  out.count(0); // intensities
}

void encode(Bytes& bytes, const Header& header, std::span<const BoundaryPoint> points) {
  constexpr const char* names[] = {"x", "y", "z", "low", "high"};
  constexpr std::uint8_t float32 = 7;
  constexpr std::uint32_t step = 4 * std::size(names);
  const auto width = static_cast<std::uint32_t>(points.size());
  CdrWriter out(bytes);
  put_header(out, header);
  out.u32(1); // height: the points are one row
  out.u32(width);
  out.count(std::size(names));
  std::uint32_t offset = 0;
  for (const char* name : names) {
    out.string(name);
    out.u32(offset);
    out.u8(float32);
    out.u32(1);
    offset += 4;
  }
  out.boolean(false); // is_bigendian
  out.u32(step);
  out.u32(step * width);
  out.count(std::size_t{step} * width);
  for (const BoundaryPoint& point : points)
    for (const float value : {point.x, point.y, point.z, point.low, point.high})
      put_integer(bytes, std::bit_cast<std::uint32_t>(value));
  out.boolean(true); // is_dense: no point is NaN
}

void encode(Bytes& bytes, const Header& header, const OccupancyGrid& grid) {
  CdrWriter out(bytes);
  put_header(out, header);
  put_time(out, header.time); // map_load_time
  out.f32(static_cast<float>(grid.resolution));
  out.u32(grid.width);
  out.u32(grid.height);
  put_reals(out, std::array{grid.x, grid.y, 0.0});
  put_reals(out, Transform().rotation);
  out.count(grid.cells.size());
  out.raw({reinterpret_cast<const std::uint8_t*>(grid.cells.data()), grid.cells.size()});
}

void encode(Bytes& bytes, const Header& header, const metric::Camera& camera) {
  CdrWriter out(bytes);
  put_header(out, header);
  out.u32(static_cast<std::uint32_t>(camera.height));
  out.u32(static_cast<std::uint32_t>(camera.width));
  const auto [lens, coefficients] = lens_of(camera);
  out.string(lens);
  out.count(coefficients);
  put_reals(out, std::span(camera.coefficients).first(coefficients));
  const double fx = camera.fx, fy = camera.fy, cx = camera.cx, cy = camera.cy;
  put_reals(out, std::array{fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0});
  put_reals(out, std::array{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0});
  put_reals(out, std::array{fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0});
  for (int i = 0; i < 6; ++i) // binning_x, binning_y; roi's offsets, height and width: all of the picture
    out.u32(0);
  out.boolean(false); // roi.do_rectify
}

void encode(Bytes& bytes, const Header& header, const GrayView& picture) {
  const auto width = static_cast<std::size_t>(picture.width),
             height = static_cast<std::size_t>(picture.height);
  CdrWriter out(bytes);
  put_header(out, header);
  out.u32(static_cast<std::uint32_t>(height));
  out.u32(static_cast<std::uint32_t>(width));
  out.string("mono8");
  out.u8(0); // is_bigendian
  out.u32(static_cast<std::uint32_t>(width));
  out.count(width * height);
  for (int y = 0; y < picture.height; ++y)
    out.raw({picture.plane.row(y), width});
}

void encode(Bytes& bytes, const Header& header, const Transform& transform) {
  CdrWriter out(bytes);
  out.count(1);
  put_header(out, header);
  out.string(transform.child);
  put_reals(out, transform.translation);
  put_reals(out, transform.rotation);
}

void encode(Bytes& bytes, const Header& header, const DiagnosticStatus& status) {
  CdrWriter out(bytes);
  put_header(out, header);
  out.count(1);
  out.u8(status.level);
  out.string(status.name);
  out.string(status.message);
  out.string(""); // hardware_id
  out.count(status.values.size());
  for (const auto& [key, value] : status.values) {
    out.string(key);
    out.string(value);
  }
}

void encode_picture(Bytes& bytes, const Header& header, ByteView file) {
  CdrWriter out(bytes);
  put_header(out, header);
  out.string("jpeg");
  out.count(file.size());
  out.raw(file);
}

void encode_video(Bytes& bytes, const Header& header, ByteView unit) {
  CdrWriter out(bytes);
  put_header(out, header);
  out.count(unit.size());
  out.raw(unit);
  out.string("h264");
}

} // namespace terrainseg::recording
