// SPDX-License-Identifier: LGPL-2.1-or-later
// What the experiments look at: labelled sequences on disk, or scenes that the project renders itself.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace terrainseg::experiments {

struct Shot {
  cv::Mat picture; ///< CV_8UC3, B G R
  cv::Mat labels;  ///< CV_8UC1: 0 obstacle, 1 terrain, 2 other ground, 3 sky, 255 not labelled
  cv::Mat depth;   ///< CV_16UC1, millimetres, 0 = none; empty where there is no range sensor
};

class Material {
 public:
  virtual ~Material() = default;
  virtual Shot shot(int index) = 0; ///< throws std::runtime_error that names the file
  std::string name;
  std::string about; ///< place and character, for a table
  double fps = 1;
  int window_bottom = 0; ///< rows to lift the training window by
  int size = 0;
  bool free = false; ///< pictures of it may be published
};

/// All sequences below `data`, or, when it is empty, rendered scenes. `limit` > 0 takes the first shots only.
std::vector<std::unique_ptr<Material>> open_material(const std::string& data, int limit);
std::vector<std::unique_ptr<Material>> rendered_material(int limit);

/// A set of different 1920x1080 pictures to measure speed on: photographs below `data`, else rendered.
std::vector<cv::Mat> speed_pictures(const std::string& data);

} // namespace terrainseg::experiments
