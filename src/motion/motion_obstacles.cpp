// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/motion_obstacles.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/touch.hpp"
#include "base/tuning.hpp"
#include "kernels/ground_warp.hpp"

namespace terrainseg {
namespace {

/// Sizes in pixels of motion's level.
TERRAINSEG_TUNED(int, motion_obstacles, longest_side, 800);
TERRAINSEG_TUNED(int, motion_obstacles, shortest_side, 160);
TERRAINSEG_TUNED(int, motion_obstacles, most_keys, 12);
TERRAINSEG_TUNED(std::size_t, motion_obstacles, most_bytes, 3'200'000); ///< for all key frames together
TERRAINSEG_TUNED(int, motion_obstacles, oldest_key, 90);                ///< frames
TERRAINSEG_TUNED(std::int64_t, motion_obstacles, longest_gap, 2'000'000'000);
constexpr PointRule large_rule{10, 6}, small_rule{4, 2};
/// Upper ends of the near zone (in the middle column) and of the far zone, Q8 of the rows between the
/// vanishing line and the bottom: 0.50, 0.22.
constexpr int near_rows = 128;
TERRAINSEG_TUNED(int, motion_obstacles, far_rows, 56);
TERRAINSEG_TUNED(int, motion_obstacles, memory, 224);       ///< Q8: earlier evidence keeps 7/8
TERRAINSEG_TUNED(int, motion_obstacles, still_memory, 252); ///< while the camera stands still
TERRAINSEG_TUNED(int, motion_obstacles, most_coasted, 8);   ///< frames for which a sudden stop is
                                                            ///< ignored, or noise
TERRAINSEG_TUNED(int, motion_obstacles, settling, 30);      ///< estimates of the vanishing line before it is
                                                            ///< reported
/// Information that these estimates must have in total. 30 frames have 530 in a town at 1 Hz, 140,000 in a
/// drive at 15 Hz, and 12,000 in a small picture in low sun.
TERRAINSEG_TUNED(std::int64_t, motion_obstacles, least_information, 2500);
/// Number of estimates before the line may deviate from a pose's line, and the smallest deviation, as a part
/// of the height. On level ground the estimates are off by up to 1/80 of the height. Where the pose's line is
/// too high, they contain only a third of the deviation: the correction removes too little, but no ground.
TERRAINSEG_TUNED(int, motion_obstacles, contradicting, 24);
TERRAINSEG_TUNED(int, motion_obstacles, slight_slope, 72);
/// Limits of what a motion leaves of the contrast, in twentieths: of the ground's motion, and of one that
/// differs from the last by less than 1/16. A frame between both gives no evidence, but earlier evidence
/// remains.
TERRAINSEG_TUNED(std::int64_t, motion_obstacles, most_left, 18);
TERRAINSEG_TUNED(std::int64_t, motion_obstacles, most_left_of_expected, 25);
constexpr std::int64_t not_of_the_ground = 1 << 20;
TERRAINSEG_TUNED(int, motion_obstacles, retry_after, 8); ///< frames between searches after a failure
/// Failures in a row after which motion rests, and the frames for which it does before two frames are
/// compared again, with a search.
TERRAINSEG_TUNED(int, motion_obstacles, patience, 16);
TERRAINSEG_TUNED(int, motion_obstacles, rest, 6);

/// Forward motions per frame with which a search starts, Q24 of the camera's height.
constexpr std::array<std::int64_t, 9> first_guesses{0,       251658,  671089,  1342177, 2348810,
                                                    3355443, 4697620, 6710886, 9227469};
constexpr int best_guesses = 3; ///< of them that are tried
/// Pitches per frame that it tries with the forward motion that tracking found: multiples of 0.015 rad, Q24.
constexpr std::int64_t pitch_step = 251658;
constexpr std::array<std::int64_t, 7> pitches{
    0, -pitch_step, pitch_step, -2 * pitch_step, 2 * pitch_step, -3 * pitch_step, 3 * pitch_step};

std::size_t most_keys_of(std::size_t pixels) {
  return std::clamp<std::size_t>(most_bytes / pixels, 3, most_keys);
}

bool stands_still(const PlaneMotion& motion) {
  const PlaneMotion still;
  return std::equal(motion.g.begin(), motion.g.end(), still.g.begin(),
                    [](std::int64_t a, std::int64_t b) { return std::abs(a - b) <= one_q24 / 8192; });
}

} // namespace

int motion_level(int frame_width, int frame_height) {
  int level = 0;
  while (std::max(subsampled(frame_width, level), subsampled(frame_height, level)) >= longest_side)
    ++level;
  return level;
}

void MotionObstacles::forget() {
  lose();
  has_before_ = false;
  step_ = {};
  pts_ = -1;
  failures_ = frames_passed_ = frames_to_rest_ = 0;
  result_ = {};
}

/// Resets the evidence after the tracking is lost.
void MotionObstacles::lose() {
  for (KeyFrame& key : keys_)
    spare_.push_back(std::move(key));
  keys_.clear();
  map_.reset(view_.width / 4, view_.height / 4);
  moving_ = false;
  coasted_ = 0;
}

std::size_t MotionObstacles::kept_bytes() const {
  std::size_t bytes = now_.capacity() + before_.capacity();
  for (const auto* list : {&keys_, &spare_})
    for (const KeyFrame& key : *list)
      bytes += key.pixels.capacity();
  return bytes;
}

void MotionObstacles::resize(int width, int height) {
  width -= width % 4;
  height -= height % 4;
  if (view_.width == width && view_.height == height)
    return;
  view_ = {width, height, std::max(width, height) * 21 / 100 * 4,
           height * 108}; // initial vanishing line at 0.42 of the height
  const auto pixels = static_cast<std::size_t>(width) * height;
  for (auto* picture : {&now_, &before_})
    picture->assign(pixels, 0);
  for (auto* cells : {&small_now_, &small_before_, &reduced_, &ground_, &judged_})
    cells->assign(pixels / 16, 0);
  cells_.assign(pixels / 16, {});
  standing_.assign(pixels / 16, 0);
  ground_columns_.assign(width / 4, 0);
  work_.assign(3 * (width + 16), 0);
  keys_.clear();
  spare_.clear();
  // Allocate all memory now, so that later frames do not allocate.
  const std::size_t most = most_keys_of(pixels);
  keys_.reserve(most);
  spare_.reserve(most);
  for (std::size_t k = 0; k < most; ++k)
    spare_.push_back({std::vector<std::uint8_t>(pixels), {}, 0});
  points_.reserve(pixels / (large_rule.block * large_rule.block) + pixels / 64);
  zone_points_.reserve(points_.room());
  alignment_.reserve(points_.room());
  parallax_.resize(width, height);
  small_points_.reserve(pixels / 16 / (small_rule.block * small_rule.block) + pixels / 64);
  line_weight_ = line_sum_ = line_information_ = 0;
  line_frames_ = line_offset_ = 0;
  forget();
}

void MotionObstacles::look(const GrayView& luma, const GrayView& ground) {
  const int width = view_.width, height = view_.height, columns = width / 4, rows = height / 4;
  now_.swap(before_);
  small_now_.swap(small_before_);
  // Rows far above the vanishing line are never ground and remain 0.
  const int first = std::clamp((view_.vanishing_row >> 8) - height / 16, 0, height - 4) / 4 * 4;
  const int small_first = first / 4;
  std::fill_n(now_.begin(), first * width, std::uint8_t{0});
  std::fill_n(small_now_.begin(), small_first * columns, std::uint8_t{0});
  kernels::high_pass(luma.plane.row(first), luma.plane.stride, width, height - first, 8, 1,
                     now_.data() + first * width, work_.data());
  for (int i = small_first; i < rows; ++i)
    kernels::mean_of_quarters(luma.plane.row(4 * i), luma.plane.stride, columns,
                              reduced_.data() + i * columns);
  kernels::high_pass(reduced_.data() + small_first * columns, columns, columns, rows - small_first, 5, 2,
                     small_now_.data() + small_first * columns, work_.data());
  for (int j = 0; j < columns; ++j)
    ground_columns_[j] = (2 * j + 1) * ground.width / (2 * columns);
  for (int i = 0; i < rows; ++i) {
    const std::uint8_t* from = ground.plane.row((2 * i + 1) * ground.height / (2 * rows));
    std::uint8_t* to = ground_.data() + i * columns;
    for (int j = 0; j < columns; ++j)
      to[j] = from[ground_columns_[j]] >> 7;
  }
  selection_.select(passed(now_), view_, ground_, 4, large_rule, points_);
  selection_.select(small_passed(small_now_), view_.quarter(), ground_, 1, small_rule, small_points_);
}

/// Length of the ground's translation in the middle column, Q8. `q8_of_rows` gives the row as a part of the
/// way from the vanishing line to the bottom.
int MotionObstacles::middle_shift(const PlaneMotion& motion, int q8_of_rows) const {
  const int down = (view_.height - 1) * 256 - view_.vanishing_row;
  return ground_shift(motion, view_, 0, down / 256 * q8_of_rows);
}

/// Refines a motion on the large picture. Returns what it leaves of the contrast, in twentieths;
/// `not_of_the_ground` when it cannot be the ground's. `still` is the residual without motion.
std::int64_t MotionObstacles::left_by(PlaneMotion& motion, int iterations, const Residual& still) {
  if (!alignment_.refine(points_, passed(before_), iterations, motion))
    return not_of_the_ground;
  const Residual after = alignment_.residual(points_, passed(before_), motion);
  const bool possible = after.points >= fewest_points && after.mean <= still.mean * 261 / 256 + 51 &&
                        after.contrast > 0 && std::abs(translation_of(motion).z) < one_q24 * 6 / 5;
  return possible ? std::int64_t{20} * after.mean / after.contrast : not_of_the_ground;
}

/// Searches this frame's motion from first guesses: the forward motion of `step` with several pitches, then
/// other forward motions. Of the pitches it tries those that explain the small picture about as well as the
/// best guess does, of the others the best ones. The first guess that fits ends the search.
bool MotionObstacles::acquire(PlaneMotion& step, const Residual& still) {
  const PassedView earlier = small_passed(small_before_);
  struct Guess {
    PlaneMotion motion;
    int mean = 0;
  };
  std::array<Guess, pitches.size() + first_guesses.size()> guesses;
  const auto guess_at = [&](std::size_t i, std::int64_t forward, std::int64_t pitch) {
    guesses[i].motion.g[5] = -pitch;
    guesses[i].motion.g[7] = forward + pitch;
    guesses[i].mean = alignment_.residual(small_points_, earlier, guesses[i].motion).mean;
  };
  const std::int64_t tracked = translation_of(step).z;
  for (std::size_t i = 0; i < pitches.size(); ++i)
    guess_at(i, tracked, pitches[i]);
  for (std::size_t i = 0; i < first_guesses.size(); ++i)
    guess_at(pitches.size() + i, first_guesses[i], 0);
  const auto others = guesses.begin() + pitches.size(), end_of_best = others + best_guesses;
  const auto is_better = [](const Guess& a, const Guess& b) {
    return a.mean != b.mean ? a.mean < b.mean : a.motion.g[7] < b.motion.g[7];
  };
  std::partial_sort(others, end_of_best, guesses.end(), is_better);
  const int best = std::min_element(guesses.begin(), end_of_best, is_better)->mean;

  int least = 1 << 30;
  const auto fits = [&](const Guess& guess) {
    PlaneMotion found = guess.motion;
    if (!alignment_.refine(small_points_, earlier, 10, found))
      return false;
    const int mean = alignment_.residual(small_points_, earlier, found).mean;
    if (mean >= least)
      return false;
    least = mean;
    step = found;
    return left_by(step, 6, still) < most_left;
  };
  return fits(guesses.front()) ||
         std::any_of(guesses.begin() + 1, others,
                     [&](const Guess& guess) { return 2 * guess.mean <= 3 * best && fits(guess); }) ||
         std::any_of(others, end_of_best, fits);
}

/// Brings the part of a picture into the cache where its points can be.
void MotionObstacles::touch_ground(const std::vector<std::uint8_t>& pixels) const {
  const std::size_t above = std::max(view_.vanishing_row >> 8, 0) * view_.width;
  touch(pixels.data() + above, std::ssize(pixels) - static_cast<std::ptrdiff_t>(above));
}

/// Computes this frame's motion since the last frame. Returns false when it cannot be found.
bool MotionObstacles::follow(std::int64_t pts) {
  const std::int64_t interval = pts >= 0 && pts_ >= 0 ? pts - pts_ : 0;
  PlaneMotion guess = step_;
  if (interval > 0 && interval_ > 0)
    guess = part_of(step_, static_cast<int>(std::clamp<std::int64_t>(256 * interval / interval_, 32, 2048)));
  const PassedView earlier = passed(before_);
  touch_ground(before_);
  const Residual still = alignment_.residual(points_, earlier, {});
  if (points_.size() < fewest_points)
    return false;
  // On bumps the previous rotation does not predict this one: also try a motion without rotation.
  PlaneMotion straight;
  straight.g[7] = translation_of(guess).z;
  const PassedView small_earlier = small_passed(small_before_);
  const auto error_of = [&](const PlaneMotion& motion) {
    return alignment_.residual(small_points_, small_earlier, motion).mean;
  };
  PlaneMotion step = error_of(straight) < error_of(guess) ? straight : guess;
  alignment_.refine(small_points_, small_earlier, 4, step);
  const std::int64_t left = left_by(step, 2, still);
  const std::int64_t expected = translation_of(guess).z;
  const PlaneMotion tracked = step;
  bool found = left < most_left;
  if (!found && (failures_ < 3 || failures_ % retry_after == 0 || failures_ >= patience))
    found = acquire(step, still);
  if (found) {
    failures_ = 0;
  } else {
    if (++failures_ >= patience)
      frames_to_rest_ = rest;
    // On faint ground noise hides a motion that goes on as before; over a longer time none does.
    const bool goes_on = moving_ && interval < 2 * half_rate_interval && coasted_ < most_coasted &&
                         left < most_left_of_expected &&
                         16 * std::abs(translation_of(tracked).z - expected) < expected;
    if (!goes_on) {
      step_ = straight;
      return false;
    }
  }
  if (interval > 0)
    interval_ = interval;
  // A rover does not stop within one frame. A sudden stop is measured when a car ahead fills the view and is
  // taken for ground.
  const std::int64_t seen = translation_of(step).z;
  if (!found) {
    ++coasted_;
    step_ = tracked;
  } else if (moving_ && expected > one_q24 / 80 && seen < expected * 6 / 10 && coasted_ < most_coasted) {
    ++coasted_;
    step_ = guess;
  } else {
    if (coasted_ == most_coasted)
      lose();
    coasted_ = 0;
    step_ = step;
  }
  return true;
}

/// Selects for each zone the newest key frame with sufficient motion, otherwise the oldest one.
void MotionObstacles::choose_keys(std::array<Zone, 2>& zones) {
  const int down = ((view_.height - 1) * 256 - view_.vanishing_row) >> 8, line = view_.vanishing_row >> 8;
  const auto cell_row = [&](int q8_of_rows) {
    return std::clamp((line + down * q8_of_rows / 256 + 3) / 4, 0, view_.height / 4);
  };
  for (Zone& zone : zones) {
    zone.first = cell_row(far_rows);
    zone.end = view_.height / 4;
    zone.near_row = down * near_rows / 256;
  }
  zones[0].near = true;
  zones[1].end = cell_row(near_rows);
  const std::array<int, 2> middle{(near_rows + 256) / 2, (far_rows + near_rows) / 2};
  for (int z = 0; z < 2; ++z) {
    Zone& zone = zones[z];
    zone.key = -1;
    for (int k = static_cast<int>(keys_.size()) - 1; k >= 0; --k) { // the newest key frame is the last
      const int shift = middle_shift(keys_[k].motion, middle[z]);
      if (shift >= 2 * 256)
        zone.key = k;
      if (shift >= target_shift())
        break;
    }
  }
  const int refined = zones[0].key;
  for (Zone& zone : zones)
    if (zone.key >= 0 && (&zone == &zones[0] || zone.key != refined)) {
      KeyFrame& key = keys_[zone.key];
      touch_ground(key.pixels);
      if (!alignment_.refine(points_, passed(key.pixels), 3, key.motion))
        zone.key = -1;
    }
}

/// Compares both zones with their key frames. The evidence is added only when the plane fits.
void MotionObstacles::judge(std::array<Zone, 2>& zones) {
  std::fill(judged_.begin(), judged_.end(), std::uint8_t{0});
  for (const Zone& zone : zones)
    if (zone.key >= 0) {
      const KeyFrame& key = keys_[zone.key];
      parallax_.compare(passed(now_), passed(key.pixels), key.motion, view_, ground_.data(), zone, cells_,
                        judged_);
    }
  int count = 0, stand = 0, lie = 0;
  for (std::size_t i = 0; i < cells_.size(); ++i)
    if (judged_[i]) {
      ++count;
      stand += cells_[i].quality > 164; // 0.04 in Q12
      lie += cells_[i].quality < -123;  // 0.03 in Q12
    }
  result_.trusted = count >= 16 && 4 * stand < count && 100 * lie > 300 * stand + 8 * count;
  if (result_.trusted)
    map_.add(cells_, judged_);
}

/// Estimates the vanishing line from the deviation of the motion that an error of the line causes.
void MotionObstacles::find_line(const std::array<Zone, 2>& zones) {
  if (told_.line == MotionKnowledge::Line::exact)
    return;
  const bool told = told_.line == MotionKnowledge::Line::near, settled = told || line_frames_ >= 90;
  if (settled && frame_ % 4 != 0)
    return;
  for (int z = 0; z < 2; ++z) {
    const Zone& zone = zones[z];
    if (zone.key < 0 || (line_frames_ >= settling && static_cast<int>(frame_ / (settled ? 4 : 1) % 2) != z))
      continue;
    const KeyFrame& key = keys_[zone.key];
    const std::int64_t forward = translation_of(key.motion).z;
    const std::int64_t most_turn = one_q24 / (settled ? 100 : 25);
    const bool pitching = std::abs(key.motion.g[5]) > most_turn || std::abs(step_.g[5]) > most_turn / 4,
               rolling = std::abs(key.motion.g[3]) > most_turn;
    if (key.age < 2 || std::abs(forward) < one_q24 / 20 || pitching || rolling)
      continue;
    // Points of the near zone above this row are near only at the sides, and would bias the line.
    const int first = zone.near ? zones[1].end : zone.first;
    zone_points_.clear();
    zone_points_.view = points_.view;
    zone_points_.reserve(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const int row = (points_.below()[i] + view_.vanishing_row) >> 10;
      if (row >= first && row < zone.end)
        zone_points_.add(points_[i]);
    }
    const Alignment::LineFit fit = alignment_.fit_line(zone_points_, passed(key.pixels), 3, key.motion);
    const std::int64_t speed = std::abs(forward) >> 12; // Q12
    const std::int64_t weight =
        std::min<std::int64_t>((fit.weight >> 10) * (speed * speed >> 12) >> 12, 1 << 30);
    if (weight <= 0)
      continue;
    const std::int64_t rows =
        std::clamp<std::int64_t>(-256 * view_.focal * fit.sigma / forward, -40 * 256, 40 * 256);
    line_weight_ += weight;
    line_information_ += weight;
    line_sum_ += weight * rows;
  }
  if (line_weight_ <= 0)
    return;
  ++line_frames_;
  if (line_frames_ % (told ? contradicting : 6) != 0)
    return;
  const std::int64_t mean = line_sum_ / line_weight_;
  line_weight_ = line_sum_ = 0;
  if (told && std::abs(mean) * slight_slope < view_.height * 256)
    return;
  const int most = told ? view_.height * 256 : settled ? 256 : 4 * 256;
  const int change = static_cast<int>(std::clamp<std::int64_t>(mean * 3 / 2, -most, most));
  move_line(change);
  if (told)
    line_offset_ += change;
}

/// Before a frame: moves the line to the one in `knowledge`.
void MotionObstacles::follow_line(const MotionKnowledge& knowledge) {
  if (knowledge.line == MotionKnowledge::Line::unknown)
    return;
  if (told_.line != knowledge.line) // the estimates so far belong to another line
    line_weight_ = line_sum_ = 0;
  if (knowledge.line == MotionKnowledge::Line::exact)
    line_offset_ = 0;
  move_line(knowledge.vanishing_row + line_offset_ - view_.vanishing_row);
}

void MotionObstacles::move_line(int rows) {
  const int row = std::clamp(view_.vanishing_row + rows, -view_.height * 256, (view_.height * 7 / 8) * 256);
  rows = row - view_.vanishing_row;
  if (rows == 0)
    return;
  for (KeyFrame& key : keys_)
    key.motion = with_line_moved(key.motion, rows, view_.focal);
  step_ = with_line_moved(step_, rows, view_.focal);
  view_.vanishing_row = row;
}

/// Stores this frame as a key frame when the ground moved by at least an eighth of the target shift since the
/// last one. When there are too many, removes the one that leaves the smallest gap between its neighbours.
void MotionObstacles::keep_frame() {
  while (!keys_.empty() && keys_.front().age > oldest_key) {
    spare_.push_back(std::move(keys_.front()));
    keys_.erase(keys_.begin());
  }
  constexpr int near_middle = (near_rows + 256) / 2;
  if (!keys_.empty() && middle_shift(keys_.back().motion, near_middle) < target_shift() / 8)
    return;
  const std::size_t most = most_keys_of(now_.size());
  if (keys_.size() >= most) {
    std::size_t least = 0;
    std::int64_t least_gap = std::int64_t{1} << 60;
    for (std::size_t k = 1; k + 1 < keys_.size(); ++k) {
      const std::int64_t older = middle_shift(keys_[k - 1].motion, near_middle),
                         newer = middle_shift(keys_[k + 1].motion, near_middle),
                         own = std::max(middle_shift(keys_[k].motion, near_middle), 1);
      const std::int64_t gap = (older - newer) * 1024 / own;
      if (gap < least_gap) {
        least_gap = gap;
        least = k;
      }
    }
    spare_.push_back(std::move(keys_[least]));
    keys_.erase(keys_.begin() + static_cast<std::ptrdiff_t>(least));
  }
  KeyFrame key = std::move(spare_.back()); // never empty: there are `most` key frames and spares in total
  spare_.pop_back();
  key.pixels = now_;
  key.motion = {};
  key.age = 0;
  keys_.push_back(std::move(key));
}

const MotionView& MotionObstacles::observe(const GrayView& luma, const GrayView& ground, std::int64_t pts,
                                           const MotionKnowledge& knowledge) {
  if (luma.empty() || ground.empty() || std::min(luma.width, luma.height) < shortest_side ||
      std::max(luma.width, luma.height) >= 2 * longest_side)
    return result_ = {};
  resize(luma.width, luma.height);
  if (pts >= 0 && pts_ >= 0 && (pts < pts_ || pts - pts_ > longest_gap))
    forget();
  // At 30 fps every second frame is skipped; the last result remains valid.
  const bool soon = pts >= 0 && pts_ >= 0 ? pts - pts_ < half_rate_interval : frames_passed_ < 1;
  if (has_before_ && soon) {
    ++frames_passed_;
    return result_;
  }
  frames_passed_ = 0;
  if (frames_to_rest_ > 0) {
    --frames_to_rest_;
    has_before_ = false;
    pts_ = pts;
    return result_;
  }
  result_ = {};
  follow_line(knowledge);
  told_ = knowledge;
  ++frame_;
  look(luma, ground);
  const bool repeated = has_before_ && now_ == before_;
  if (repeated) {
    result_.steady = true;
  } else if (has_before_) {
    result_.steady = follow(pts);
    if (!result_.steady) {
      lose();
    } else {
      const bool still = stands_still(step_);
      moving_ = moving_ || !still;
      for (KeyFrame& key : keys_) {
        key.motion = compose(key.motion, step_);
        ++key.age;
      }
      map_.move(step_, view_, still ? still_memory : memory);
      if (coasted_ == 0) {
        std::array<Zone, 2> zones;
        choose_keys(zones);
        judge(zones);
        find_line(zones);
      }
    }
  }
  if (!repeated && coasted_ == 0)
    keep_frame();
  has_before_ = true;
  pts_ = pts;
  map_.read(view_, standing_);
  result_.columns = view_.width / 4;
  result_.rows = view_.height / 4;
  result_.standing = standing_;
  result_.vanishing_row = view_.vanishing_row;
  result_.line_offset = line_offset_;
  result_.line_settled = told_.line != MotionKnowledge::Line::unknown ||
                         (line_frames_ >= settling && line_information_ >= least_information);
  if (result_.steady && interval_ > 0)
    result_.speed_over_height = translation_of(step_).z * 1'000'000'000 / interval_ >> 8;
  return result_;
}

} // namespace terrainseg
