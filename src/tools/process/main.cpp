// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-process: the filter over files, without a screen.
#include <csignal>
#include <cstdio>

#include <algorithm>
#include <chrono>
#include <clocale>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "tools/process/display.hpp"
#include "tools/process/elements.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"
#include "tools/process/pipeline.hpp"

using namespace terrainseg::process;

namespace {

using Clock = std::chrono::steady_clock;

std::atomic<int> interruptions{0};
std::atomic<int> last_signal{0};

extern "C" void on_signal(int signal) {
  last_signal = signal;
  ++interruptions;
}

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

void complain(const std::string& text) {
  std::fprintf(stderr, "terrainseg-process: %s\n", text.c_str());
}

/// Refuses wrong settings before the first file is touched.
std::optional<std::string> check_settings(const Options& options) {
  const ElementPointer terrainseg(gst_element_factory_make("terrainseg", nullptr));
  const ElementPointer overlay(options.wanted[static_cast<int>(Output::annotated)]
                                   ? gst_element_factory_make("terrainoverlay", nullptr)
                                   : nullptr);
  for (const ElementPointer* element : {&terrainseg, &overlay})
    if (*element)
      gst_object_ref_sink(element->get());
  return apply_settings(options, terrainseg.get(), overlay.get());
}

/// All inputs of a run, shared by the workers and the display.
class Batch {
 public:
  Batch(const Options& options, std::vector<Input> inputs)
      : options_(options), inputs_(std::move(inputs)), display_(options.quiet), begin_(Clock::now()) {
    for (std::size_t i = 0; i < inputs_.size(); ++i)
      works_.push_back(std::make_unique<Work>());
  }

  Exit run();

 private:
  enum class Phase { waiting, running, done, skipped };
  struct Work {
    Progress progress;
    Phase phase = Phase::waiting;
  };

  Naming naming_of(const Input& input) const {
    return Naming(options_.output_dir, options_.name.value_or(input.stem));
  }
  void work();
  void report(const Input& input, const Outcome& outcome);
  void report_skip(const Input& input);
  void show();

  const Options& options_;
  const std::vector<Input> inputs_;
  std::vector<std::unique_ptr<Work>> works_;
  std::mutex mutex_; ///< guards phases, next_, failures_, done_, the display and what is printed
  std::condition_variable changed_;
  std::size_t next_ = 0;
  int failures_ = 0;
  int finished_ = 0;
  int working_threads_ = 0;
  Display display_;
  Rate rate_; ///< the display's thread only
  const Clock::time_point begin_;
};

void Batch::report_skip(const Input& input) {
  if (options_.quiet)
    return;
  display_.clear();
  std::printf("%s: complete already, skipped\n", input.label.c_str());
  std::fflush(stdout);
}

void Batch::report(const Input& input, const Outcome& outcome) {
  display_.clear();
  const Record& record = outcome.record;
  const bool kept = outcome.kind == Outcome::Kind::complete || outcome.kind == Outcome::Kind::partial;
  if (kept && !options_.quiet) {
    const bool partial = outcome.kind == Outcome::Kind::partial;
    char fps[G_ASCII_DTOSTR_BUF_SIZE], share[G_ASCII_DTOSTR_BUF_SIZE];
    g_ascii_formatd(fps, sizeof fps, "%.1f", record.fps());
    g_ascii_formatd(share, sizeof share, "%.1f", 100 * record.traversable());
    std::printf("%s: %s%llu frames, %s fps, %s %% traversable -> %s\n", input.label.c_str(),
                partial ? "PARTIAL, " : "", static_cast<unsigned long long>(record.frames), fps, share,
                naming_of(input).record(partial).string().c_str());
    std::fflush(stdout);
  }
  switch (outcome.kind) {
  case Outcome::Kind::complete:
  case Outcome::Kind::interrupted:
    break;
  case Outcome::Kind::partial:
    complain(input.label + ": " + record.problem + "; the " + std::to_string(record.frames) +
             " frames that could be decoded are kept as " +
             naming_of(input).record(true).stem().stem().string() + ".*");
    break;
  case Outcome::Kind::failed:
    complain(input.label + ": " + record.problem);
    break;
  }
}

/// One worker: takes inputs in order until none is left or the user has had enough.
void Batch::work() {
  std::unique_lock lock(mutex_);
  while (next_ < inputs_.size() && interruptions == 0) {
    const std::size_t index = next_++;
    const Input& input = inputs_[index];
    Work& work = *works_[index];
    work.phase = Phase::running;
    lock.unlock();
    const Naming naming = naming_of(input);
    const bool skip = options_.resume && input.problem.empty() && is_complete(naming, input, options_);
    Outcome outcome;
    if (!skip) {
      try {
        outcome = process(input, naming, options_, work.progress, interruptions);
      } catch (const std::exception& error) {
        outcome.record.problem = error.what();
      }
    }
    lock.lock();
    if (skip)
      report_skip(input);
    else
      report(input, outcome);
    work.phase = skip ? Phase::skipped : Phase::done;
    ++finished_;
    failures_ += !skip && outcome.kind != Outcome::Kind::complete;
    changed_.notify_all();
  }
  --working_threads_;
  changed_.notify_all();
}

void Batch::show() {
  Moment moment;
  moment.inputs = static_cast<int>(inputs_.size());
  moment.done = finished_;
  moment.seconds = seconds_since(begin_);
  std::uint64_t all_frames = 0;
  int running = 0, running_permille = 0, done_permille = 0, to_do = 0;
  bool known = true;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    const Work& work = *works_[i];
    all_frames += work.progress.frames;
    if (work.phase != Phase::skipped)
      ++to_do;
    if (work.phase == Phase::done)
      done_permille += 1000;
    if (work.phase != Phase::running)
      continue;
    ++running;
    moment.frames += work.progress.frames;
    const int permille = work.progress.permille;
    known = known && permille >= 0;
    running_permille += std::max(permille, 0);
    moment.name += (moment.name.empty() ? "" : ", ") + inputs_[i].label;
  }
  moment.fps = rate_.at(moment.seconds, all_frames);
  if (running == 0)
    return;
  if (running > 1)
    moment.name = std::to_string(running) + " at a time: " + moment.name;
  moment.permille = known ? running_permille / running : -1;
  moment.whole_permille = known ? (done_permille + running_permille) / to_do : -1;
  display_.show(moment);
}

Exit Batch::run() {
  std::vector<std::thread> threads;
  const std::size_t count = std::min<std::size_t>(static_cast<std::size_t>(options_.jobs), inputs_.size());
  working_threads_ = static_cast<int>(count);
  for (std::size_t i = 0; i < count; ++i)
    threads.emplace_back([this] { work(); });
  {
    std::unique_lock lock(mutex_);
    while (working_threads_ > 0) {
      changed_.wait_for(lock, std::chrono::duration<double>(display_.interval()));
      show();
    }
    display_.clear();
  }
  for (std::thread& thread : threads)
    thread.join();
  return failures_ > 0 || finished_ < static_cast<int>(inputs_.size()) ? Exit::some_failed : Exit::ok;
}

int process(int argc, char** argv) {
  std::setlocale(LC_CTYPE, ""); // file names on the command line; numbers stay as they are
  point_to_own_plugin();
  const auto parsed = parse_options(argc, argv);
  if (const EarlyExit* early = std::get_if<EarlyExit>(&parsed)) {
    if (!early->message.empty())
      complain(early->message);
    return static_cast<int>(early->code);
  }
  const Options& options = std::get<Options>(parsed);
  if (auto problem = missing_elements(options)) {
    complain(*problem);
    return static_cast<int>(Exit::environment);
  }
  if (auto problem = check_settings(options)) {
    complain(*problem);
    return static_cast<int>(Exit::usage);
  }
  std::vector<Input> inputs = find_inputs(options.inputs);
  if (options.name && inputs.size() > 1) {
    complain("--name is for one input, but these are " + std::to_string(inputs.size()));
    return static_cast<int>(Exit::usage);
  }
  if (auto problem = prepare_folder(options.output_dir)) {
    complain(*problem);
    return static_cast<int>(Exit::output);
  }
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);

  const Exit result = Batch(options, std::move(inputs)).run();
  if (last_signal && result != Exit::ok) {
    complain("interrupted; finished outputs are kept, the unfinished one is gone");
    return 128 + last_signal;
  }
  return static_cast<int>(result);
}

} // namespace

int main(int argc, char** argv) {
  try {
    return process(argc, argv);
  } catch (const std::exception& problem) { // such as no memory
    std::fprintf(stderr, "terrainseg-process: %s\n", problem.what());
    return static_cast<int>(Exit::some_failed);
  }
}
