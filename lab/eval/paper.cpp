// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <stdexcept>

#include <opencv2/core.hpp>

#include "lab/eval/options.hpp"
#include "lab/eval/paper.hpp"
#include "lab/eval/paper_parts.hpp"
#include "lab/eval/rendered.hpp"

namespace terrainseg::eval {

namespace fs = std::filesystem;

std::vector<Sequence> paper_sequences(const std::string& data, const Selection& selection) {
  std::vector<Sequence> all = data.empty() ? rendered_for_paper(selection) : sequences_in(data, selection);
  for (Sequence& s : all)
    s.things_every = 0;
  return all;
}

std::vector<Picture> speed_pictures(const std::string& data) {
  const cv::Size hd(1920, 1080);
  std::vector<std::string> photographs;
  if (const fs::path folder = fs::path(data) / "hd_frames"; !data.empty() && fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".png" || entry.path().extension() == ".jpg")
        photographs.push_back(entry.path().string());
  std::sort(photographs.begin(), photographs.end());
  std::vector<Picture> pictures;
  for (const std::string& path : photographs)
    // NOLINTNEXTLINE(performance-inefficient-vector-operation)
    pictures.push_back(Picture::read(path).resized(hd));
  if (const Sequence trail = rendered_trail(hd); pictures.empty())
    for (std::size_t i = 0; i < trail.size(); ++i)
      pictures.push_back(trail.read(i).picture);
  return pictures;
}

void run_paper(const std::vector<std::string>& arguments) {
  struct Part {
    const char* name;
    std::string (*run)(const Context&);
  };
  constexpr Part parts[] = {{"table1", stage_times},
                            {"table2", error_rates},
                            {"curves", scale_and_shift},
                            {"training", training_pixels},
                            {"readings", readings}};
  const PaperOptions a = parse_paper_options(arguments, true);
  for (const std::string& name : a.only)
    if (std::none_of(std::begin(parts), std::end(parts), [&](const Part& part) { return part.name == name; }))
      throw UsageError("--only " + name + ": no such part");
  std::filesystem::create_directories(a.out);
  const Context context{a.data, a.out, a.selection,
                        [](const std::string& what) { std::cerr << what << '\n'; }};
  cv::setNumThreads(1); // everything is measured on one thread
  const std::string path = a.out + "/paper.md";
  std::ofstream report(path);
  report << "# The paper's experiments\n\nMade by `terrainseg-eval paper` from "
         << (a.data.empty() ? "rendered scenes (no data folder was given)" : "labelled sequences")
         << (a.selection.limit > 0
                 ? ", the first " + std::to_string(a.selection.limit) + " of each one's frames"
                 : "")
         << ".\n";
  for (const Part& part : parts)
    if (a.only.empty() || std::find(a.only.begin(), a.only.end(), part.name) != a.only.end()) {
      const std::string text = part.run(context);
      report << '\n' << text << std::flush;
      std::cout << text << '\n' << std::flush;
    }
  if (!report)
    throw std::runtime_error(path + ": cannot be written");
}

} // namespace terrainseg::eval
