// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-process: the filter over files, without a screen.
#include <csignal>
#include <cstdio>

#include <algorithm>
#include <array>
#include <chrono>
#include <clocale>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "exchange/counted.hpp"
#include "tools/command_line.hpp"
#include "tools/process/display.hpp"
#include "tools/process/elements.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/manifest.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"
#include "tools/process/worker.hpp"

using namespace terrainseg::process;
using terrainseg::counted;

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

/// Prints the conflicts and throws if the run would overwrite files.
void refuse_conflicts(const std::vector<Input>& inputs, const Options& options) {
  constexpr std::size_t shown = 20;
  const std::vector<std::string> conflicts = find_conflicts(inputs, options);
  for (std::size_t i = 0; i < std::min(conflicts.size(), shown); ++i)
    complain(conflicts[i]);
  if (conflicts.size() > shown)
    complain("and " + std::to_string(conflicts.size() - shown) + " more like these");
  if (!conflicts.empty())
    throw EarlyExit{Exit::usage, "nothing was written"};
}

/// Number of inputs of a run by result.
class Tally {
 public:
  explicit Tally(std::size_t inputs) : inputs_(inputs) { of(Outcome::Kind::interrupted) = inputs; }
  void add(const Outcome& outcome) {
    --of(Outcome::Kind::interrupted);
    ++of(outcome.kind);
    later_ += may_pass_later(outcome.record.fault.cause);
    if (outcome.kept())
      frames_ += outcome.record.frames;
  }
  Exit exit_code() {
    if (later_ > 0 || of(Outcome::Kind::interrupted) > 0)
      return Exit::try_again;
    return of(Outcome::Kind::partial) + of(Outcome::Kind::failed) > 0 ? Exit::damaged : Exit::ok;
  }
  std::string line(double seconds) {
    std::string text =
        counted(inputs_, "input") + ": " + std::to_string(of(Outcome::Kind::complete)) + " complete";
    const std::pair<std::size_t, const char*> others[] = {{of(Outcome::Kind::skipped), "skipped"},
                                                          {of(Outcome::Kind::partial), "partial"},
                                                          {of(Outcome::Kind::failed), "failed"},
                                                          {of(Outcome::Kind::interrupted), "not done"}};
    for (const auto& [count, what] : others)
      if (count > 0)
        text += ", " + std::to_string(count) + " " + what;
    if (later_ > 0)
      text += " (" + std::to_string(later_) + " may succeed when tried again)";
    return text + "; " + counted(frames_, "frame") + " in " + duration_text(seconds);
  }

 private:
  std::size_t& of(Outcome::Kind kind) { return counts_[static_cast<std::size_t>(kind)]; }
  const std::size_t inputs_;
  std::array<std::size_t, Outcome::kinds> counts_{}; ///< what is not done counts as interrupted
  std::size_t later_ = 0;
  std::uint64_t frames_ = 0;
};

/// The inputs of a run, shared by the workers and the display.
class Batch {
 public:
  /// `arguments` are the program's. `manifest` may not be open.
  Batch(const Options& options, std::vector<Input> inputs, AtomicFile& manifest,
        std::vector<std::string> arguments)
      : options_(options), manifest_(manifest), inputs_(std::move(inputs)), arguments_(std::move(arguments)),
        works_(inputs_.size()), tally_(inputs_.size()), display_(options.quiet), begin_(Clock::now()) {}

  Exit run();

 private:
  enum class Phase { waiting, running, done, skipped };
  struct Work {
    Progress progress;
    Phase phase = Phase::waiting;
  };

  void work();
  void report(const Input& input, const Outcome& outcome);
  Outcome outcome_of(const Input& input, Worker& worker, Progress& progress) const;
  void show();

  const Options& options_;
  AtomicFile& manifest_;
  const std::vector<Input> inputs_;
  const std::vector<std::string> arguments_;
  std::deque<Work> works_; ///< of the inputs
  std::mutex mutex_;       ///< guards phases, next_, tally_, done_, the display and the output
  std::condition_variable changed_;
  std::size_t next_ = 0;
  Tally tally_;
  int working_threads_ = 0;
  Display display_;
  Rate rate_; ///< display thread only
  const Clock::time_point begin_;
};

void Batch::report(const Input& input, const Outcome& outcome) {
  display_.clear();
  const Record& record = outcome.record;
  const bool partial = outcome.kind == Outcome::Kind::partial;
  if (outcome.kind == Outcome::Kind::skipped && !options_.quiet)
    std::printf("%s: already complete, skipped\n", input.label.c_str());
  if (outcome.kept() && !options_.quiet)
    std::printf("%s: %s%s, %s fps, filter %s ms, %s %% traversable -> %s\n", input.label.c_str(),
                partial ? "PARTIAL, " : "", counted(record.frames, "frame").c_str(),
                number_text("%.1f", record.fps()).c_str(),
                number_text("%.2f", record.filter_milliseconds).c_str(),
                number_text("%.1f", 100 * record.traversable()).c_str(),
                Naming(options_, input).record(partial).string().c_str());
  std::fflush(stdout);
  if (!options_.quiet)
    for (const std::string& warning : record.warnings)
      complain(input.label + ": warning: " + warning);
  if (outcome.kept() && record.still_rows > 0 && !options_.quiet)
    complain(input.label + ": the lowest " + std::to_string(record.still_rows) +
             " rows never change (a bonnet, a black bar?): do not learn them as ground, with --set "
             "window-bottom=" +
             std::to_string(record.still_rows) +
             ", and take them out of the mask with --set ignore-regions=...");
  if (partial)
    complain(input.label + ": " + record.fault.text + "; what could be decoded, " +
             counted(record.frames, "frame") + ", is kept as " +
             Naming(options_, input).record(true).stem().stem().string() + ".*");
  if (outcome.kind == Outcome::Kind::failed)
    complain(input.label + ": " + record.fault.text);
}

Outcome Batch::outcome_of(const Input& input, Worker& worker, Progress& progress) const {
  if (options_.resume && !input.fault && is_complete(input, options_))
    return {Outcome::Kind::skipped, {}};
  try {
    return worker.process(input, options_, progress, interruptions);
  } catch (const std::exception& error) {
    return failed({}, {Cause::resources, error.what()});
  }
}

/// A job: processes inputs in order until none is left or the user interrupts.
void Batch::work() {
  Worker worker(arguments_);
  std::unique_lock lock(mutex_);
  while (next_ < inputs_.size() && interruptions == 0) {
    const std::size_t index = next_++;
    const Input& input = inputs_[index];
    Work& work = works_[index];
    work.phase = Phase::running;
    lock.unlock();
    const Outcome outcome = outcome_of(input, worker, work.progress);
    const bool listed = manifest_.fd() >= 0;
    const std::string line = listed ? manifest_line(options_, input, outcome) : "";
    lock.lock();
    if (listed) {
      manifest_.write(line);
      manifest_.flush();
    }
    report(input, outcome);
    work.phase = outcome.kind == Outcome::Kind::skipped ? Phase::skipped : Phase::done;
    tally_.add(outcome);
    changed_.notify_all();
  }
  --working_threads_;
  changed_.notify_all();
}

void Batch::show() {
  Moment moment;
  moment.inputs = static_cast<int>(inputs_.size());
  moment.seconds = seconds_since(begin_);
  std::uint64_t all_frames = 0;
  int running = 0, running_permille = 0, done_permille = 0, to_do = 0;
  bool known = true;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    const Work& work = works_[i];
    all_frames += work.progress.frames;
    moment.done += work.phase >= Phase::done;
    to_do += work.phase != Phase::skipped;
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

/// Starts up to `jobs` threads, or fewer if the system allows no more, and shows their progress.
Exit Batch::run() {
  std::vector<std::thread> threads;
  std::unique_lock lock(mutex_);
  try {
    while (threads.size() < std::min(static_cast<std::size_t>(options_.jobs), inputs_.size())) {
      threads.emplace_back([this] { work(); });
      ++working_threads_;
    }
  } catch (const std::system_error& error) {
    complain(std::string("no thread for a job: ") + error.what());
  }
  while (working_threads_ > 0) {
    changed_.wait_for(lock, std::chrono::duration<double>(display_.interval()));
    show();
  }
  display_.clear();
  lock.unlock();
  for (std::thread& thread : threads)
    thread.join();
  if (!options_.quiet && inputs_.size() > 1)
    std::printf("%s\n", tally_.line(seconds_since(begin_)).c_str());
  return tally_.exit_code();
}

/// --check: prints what is missing or damaged.
Exit check(const Options& options, const std::vector<Input>& inputs) {
  const Check found = check_manifest(options, inputs);
  for (const auto* list : {&found.again, &found.damaged})
    for (const std::string& line : *list)
      complain(line);
  if (!options.quiet)
    std::printf("%zu complete, %zu permanently damaged, %zu to try again\n", found.whole,
                found.damaged.size(), found.again.size());
  return !found.again.empty() ? Exit::try_again : !found.damaged.empty() ? Exit::damaged : Exit::ok;
}

/// The exit code for an output that cannot be written.
Exit exit_for(const Fault& fault) {
  return may_pass_later(fault.cause) ? Exit::try_again : Exit::output;
}

/// The inputs of the run that this process takes; throws EarlyExit if they cannot be processed.
std::vector<Input> inputs_of(const Options& options) {
  auto [inputs, notes] = find_inputs(options.inputs, options.names);
  if (inputs.empty())
    throw EarlyExit{Exit::usage, "--inputs-from: the list is empty"};
  if (!options.quiet)
    for (const std::string& note : notes)
      complain(note);
  if (!options.quiet && options.fps_given &&
      std::none_of(inputs.begin(), inputs.end(),
                   [](const Input& input) { return input.kind == Input::Kind::images; }))
    complain("warning: --fps is for image sequences; what is named here has a frame rate of its own, and "
             "keeps it");
  if (options.name && inputs.size() > 1)
    throw EarlyExit{Exit::usage, "--name is for one input, but these are " + std::to_string(inputs.size())};
  refuse_long_names(inputs, options);
  // Checks the whole list, not only this shard: all concurrent tasks must refuse a conflict.
  refuse_conflicts(inputs, options);
  return share_of(options.shard, std::move(inputs));
}

Exit process(const std::vector<std::string>& arguments) {
  const Options options = parse_options(arguments);
  if (options.worker_socket >= 0) {
    std::signal(SIGPIPE, SIG_IGN);
    listen_to_the_log(arguments);
    serve(options.worker_socket, options);
  }
  if (!options.check.empty())
    return check(options, share_of(options.shard, find_inputs(options.inputs, options.names).inputs));
  check_elements(options);
  check_settings(options);
  std::vector<Input> inputs = inputs_of(options);
  prepare_folder(options.output_dir);
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  std::signal(SIGPIPE, SIG_IGN);

  AtomicFile manifest;
  if (!options.manifest.empty()) {
    manifest.open(options.manifest);
    manifest.write(manifest_head(options, inputs.size()));
    manifest.flush();
  }
  Exit result = Batch(options, std::move(inputs), manifest, arguments).run();
  try {
    if (manifest.fd() >= 0)
      manifest.commit(options.manifest);
  } catch (const Fault& fault) {
    complain(fault.text);
    result = exit_for(fault);
  }
  if (last_signal && result != Exit::ok) {
    complain("interrupted; finished outputs are kept, the unfinished one is gone");
    return last_signal == SIGINT ? Exit::interrupted : Exit::try_again;
  }
  return result;
}

} // namespace

int main(int argc, char** argv) {
  EarlyExit early;
  try {
    std::setlocale(LC_CTYPE, "");                               // for file names; numbers keep decimal points
    if (argc < 2 || std::string_view(argv[1]) != worker_option) // a worker inherits it from the run
      point_to_own_plugin();
    return static_cast<int>(process({argv, argv + argc}));
  } catch (const EarlyExit& reason) {
    early = reason;
  } catch (const Fault& fault) {
    early = {exit_for(fault), fault.text};
  } catch (const terrainseg::tools::UsageError& error) {
    early = {Exit::usage, error.what()};
  } catch (const std::exception& problem) { // such as out of memory
    early = {Exit::try_again, problem.what()};
  }
  if (!early.message.empty())
    complain(early.message);
  return static_cast<int>(early.code);
}
