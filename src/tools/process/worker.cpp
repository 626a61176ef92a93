// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/worker.hpp"

#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "exchange/write_all.hpp"
#include "tools/process/conflicts.hpp"
#include "tools/process/reasons.hpp"
#include "tools/process/running_clock.hpp"

extern char** environ;

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int tick = 100; // interval of checking signals and progress, milliseconds

/// Exit code of a worker whose pipeline hangs.
constexpr int hangs = 124;
/// Time limit of a pipeline that the user interrupted.
constexpr std::chrono::seconds interrupted_limit{10};

/// Kind of a message: its first byte.
enum Kind : char { work = 'w', interrupt = 'i', progress_made = 'p', done = 'd' };

/// Messages with a length in front. If the other end is closed, a message is lost; the reader detects that.
void send(int socket, Kind kind, const std::string& content) {
  const std::uint32_t length = static_cast<std::uint32_t>(content.size() + 1);
  std::string bytes(reinterpret_cast<const char*>(&length), sizeof length);
  bytes += static_cast<char>(kind);
  bytes += content;
  write_all(socket, {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

class Messages {
 public:
  explicit Messages(int socket) : socket_(socket) {}
  /// Waits at most a tick for data. Returns false if the other end is closed.
  bool receive() {
    pollfd what{socket_, POLLIN, 0};
    if (poll(&what, 1, tick) <= 0)
      return true;
    char bytes[65536];
    const ssize_t count = read(socket_, bytes, sizeof bytes);
    if (count <= 0)
      return count < 0 && errno == EINTR;
    bytes_.append(bytes, static_cast<std::size_t>(count));
    return true;
  }
  /// The next complete message: its kind and its content.
  std::optional<std::pair<char, std::string>> next() {
    std::uint32_t length = 0;
    if (bytes_.size() < sizeof length)
      return std::nullopt;
    std::memcpy(&length, bytes_.data(), sizeof length);
    if (length == 0 || bytes_.size() < sizeof length + length)
      return std::nullopt;
    std::pair message(bytes_[sizeof length], bytes_.substr(sizeof length + 1, length - 1));
    bytes_.erase(0, sizeof length + length);
    return message;
  }

 private:
  int socket_;
  std::string bytes_;
};

std::string packed(const json& value) {
  const std::vector<std::uint8_t> bytes = json::to_msgpack(value);
  return {bytes.begin(), bytes.end()};
}

Outcome lost(const Input& input, const Options& options, Cause cause, const std::string& problem) {
  Outcome outcome;
  outcome.record.input = input.label;
  outcome.record.place = input.place();
  outcome.record.identity = input.identity();
  outcome.record.settings = describe(options, input);
  outcome.record.cause = cause;
  outcome.record.problem = problem;
  return outcome;
}

/// Removes the unfinished files of a crashed worker. Opening a file takes its lock, and deletes it at the
/// end.
void remove_parts(const Naming& naming, const Options& options) {
  AtomicFile record;
  if (record.open(naming.record()))
    return;
  for (int i = 0; i < output_count; ++i) {
    const fs::path path = naming.output(static_cast<Output>(i));
    std::error_code error;
    if (!options.wanted[i] || !fs::exists(path.parent_path(), error))
      continue;
    {
      AtomicFile part;
      if (part.open(path))
        continue;
    }
    if (path.parent_path() != naming.record().parent_path())
      fs::remove(path.parent_path(), error); // folder of a recording; fails if it contains other files
  }
}

json to_json(const Record& record) {
  json outputs = json::array();
  for (const auto& output : record.outputs)
    outputs.push_back(output ? json{output->file, output->bytes} : json());
  return {{"input", record.input},
          {"place", record.place},
          {"bytes", record.identity.bytes},
          {"fingerprint", record.identity.fingerprint},
          {"settings", record.settings},
          {"problem", record.problem},
          {"cause", record.cause},
          {"frames", record.frames},
          {"width", record.width},
          {"height", record.height},
          {"seconds", record.seconds},
          {"traversable_sum", record.traversable_sum},
          {"blocked", record.blocked},
          {"horizon_frames", record.horizon_frames},
          {"filter_milliseconds", record.filter_milliseconds},
          {"still_rows", record.still_rows},
          {"warnings", record.warnings},
          {"outputs", outputs}};
}

Record to_record(const json& from) {
  Record record;
  record.input = from.at("input");
  record.place = from.at("place");
  record.identity = {from.at("bytes"), from.at("fingerprint")};
  record.settings = from.at("settings");
  record.problem = from.at("problem");
  record.cause = from.at("cause");
  record.frames = from.at("frames");
  record.width = from.at("width");
  record.height = from.at("height");
  record.seconds = from.at("seconds");
  record.traversable_sum = from.at("traversable_sum");
  record.blocked = from.at("blocked");
  record.horizon_frames = from.at("horizon_frames");
  record.filter_milliseconds = from.at("filter_milliseconds");
  record.still_rows = from.at("still_rows");
  record.warnings = from.at("warnings").get<std::vector<std::string>>();
  for (std::size_t i = 0; i < record.outputs.size(); ++i)
    if (const json& output = from.at("outputs").at(i); !output.is_null())
      record.outputs[i] = Record::Written{output.at(0), output.at(1)};
  return record;
}

/// A worker's end of the socket, for its two threads.
class Line {
 public:
  Line(int socket, const Options& options) : socket_(socket), options_(options) {}
  [[noreturn]] void work_on();
  [[noreturn]] void listen();

 private:
  void tell_progress();
  bool hangs_now();

  const int socket_;
  const Options& options_;
  std::atomic<int> interrupted_{0};
  std::mutex mutex_; ///< guards the following members, and sending
  std::condition_variable given_;
  std::optional<Input> input_;         ///< input to process
  std::unique_ptr<Progress> progress_; ///< progress of the current input
  std::uint64_t told_frames_ = 0;
  RunningClock clock_; ///< this and the following: of the listening thread
  RunningClock::Clock::duration last_answer_{};
  std::uint64_t last_answers_ = 0;
};

/// Processes requests.
void Line::work_on() {
  for (;;) {
    std::unique_lock lock(mutex_);
    given_.wait(lock, [this] { return input_.has_value(); });
    const Input input = *std::exchange(input_, std::nullopt);
    forget_the_log();
    progress_ = std::make_unique<Progress>();
    Progress& progress = *progress_;
    lock.unlock();
    Outcome outcome;
    try {
      outcome = process(input, naming_of(options_, input), options_, progress, interrupted_);
    } catch (const std::exception& error) {
      outcome = lost(input, options_, Cause::resources, error.what());
    }
    lock.lock();
    tell_progress();
    progress_.reset();
    send(socket_, done, packed(outcome));
  }
}

/// Receives the run's messages and sends the progress. If the run has ended, the worker exits at once:
/// unfinished files remain as after a power failure.
void Line::listen() {
  Messages messages(socket_);
  while (messages.receive()) {
    const std::lock_guard lock(mutex_);
    while (const auto message = messages.next()) {
      if (message->first == interrupt)
        ++interrupted_;
      else if (message->first == work)
        input_ = unpacked_input(message->second);
      given_.notify_all();
    }
    tell_progress();
    if (hangs_now())
      std::quick_exit(hangs);
  }
  std::quick_exit(0); // skips destructors, because other threads may hold locks
}

/// Whether an element does not return from a call, such as the one that stops it.
bool Line::hangs_now() {
  const auto now = clock_.now();
  const std::uint64_t answers = progress_ ? progress_->answers.load() : 0;
  if (answers == 0 || std::exchange(last_answers_, answers) != answers)
    last_answer_ = now;
  std::chrono::seconds limit(options_.stall_seconds);
  if (interrupted_)
    limit = std::min(limit, interrupted_limit);
  return now - last_answer_ > limit;
}

void Line::tell_progress() {
  if (!progress_ || progress_->frames == told_frames_)
    return;
  told_frames_ = progress_->frames;
  send(socket_, progress_made, packed(json{told_frames_, progress_->permille.load()}));
}

} // namespace

std::string packed(const Input& input) {
  json images = json::array();
  for (const fs::path& image : input.images)
    images.push_back(image.string());
  return packed(json{{"kind", input.kind},
                     {"label", input.label},
                     {"stem", input.stem},
                     {"path", input.path.string()},
                     {"images", images},
                     {"problem", input.problem},
                     {"cause", input.cause}});
}

std::string packed(const Outcome& outcome) {
  return packed(json{{"kind", outcome.kind}, {"record", to_json(outcome.record)}});
}

Input unpacked_input(const std::string& bytes) {
  const json from = json::from_msgpack(bytes);
  Input input;
  input.kind = from.at("kind");
  input.label = from.at("label");
  input.stem = from.at("stem");
  input.path = from.at("path").get<std::string>();
  for (const json& image : from.at("images"))
    input.images.emplace_back(image.get<std::string>());
  input.problem = from.at("problem");
  input.cause = from.at("cause");
  return input;
}

Outcome unpacked_outcome(const std::string& bytes) {
  const json from = json::from_msgpack(bytes);
  Outcome outcome;
  outcome.kind = from.at("kind");
  outcome.record = to_record(from.at("record"));
  return outcome;
}

Loss loss_of(int status, bool file) {
  if (WIFEXITED(status) && WEXITSTATUS(status) == hangs)
    return {Cause::stalled, "an element of GStreamer did not start or stop in the time of --stall-timeout; "
                            "no output is kept"};
  const int number = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  const std::string named =
      number ? "signal " + std::to_string(number) + ", " + strsignal(number)
             : "exit code " + std::to_string(WIFEXITED(status) ? WEXITSTATUS(status) : status);
  for (const int ended : {SIGKILL, SIGTERM, SIGINT, SIGHUP, SIGQUIT, SIGXCPU})
    if (number == ended)
      return {Cause::resources, "the process that decoded it was killed from outside (" + named +
                                    "): by a user, or because memory ran out; a smaller --jobs needs less"};
  return {Cause::crashed,
          "the decoder crashed (" + named + "); no output is kept; " +
              (file ? make_it_anew
                    : "if another program (ffmpeg) can read it, process the output of that program")};
}

void serve(int socket, const Options& options) {
  static Line line(socket, options); // static: its threads run until the process ends
  std::thread([] { line.listen(); }).detach();
  line.work_on();
}

Worker::~Worker() {
  stop();
}

bool Worker::start() {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    return false;
  std::vector<std::string> words = {arguments_.front(), worker_option, std::to_string(ends[1])};
  words.insert(words.end(), arguments_.begin() + 1, arguments_.end());
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words)
    pointers.push_back(word.data());
  pointers.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], ends[1]); // remains open in the child
  // Ctrl-C reaches all processes of a terminal, `kill` only one: workers ignore both and get a message from
  // the run.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t told;
  sigemptyset(&told);
  sigaddset(&told, SIGINT);
  sigaddset(&told, SIGTERM);
  posix_spawnattr_setsigmask(&attributes, &told);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  const int error = posix_spawn(&pid_, "/proc/self/exe", &actions, &attributes, pointers.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (error != 0) {
    close(ends[0]);
    pid_ = -1;
    return false;
  }
  socket_ = ends[0];
  return true;
}

/// Exit status as from waitpid(). The process ends when its socket is closed.
int Worker::stop() {
  if (pid_ < 0)
    return 0;
  close(socket_);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return status;
}

/// Returns nothing if the process is lost before it answers.
std::optional<Outcome> Worker::ask(const Input& input, Progress& progress,
                                   const std::atomic<int>& interrupted) {
  send(socket_, work, packed(input));
  Messages messages(socket_);
  for (int told = 0; messages.receive();) {
    while (const auto message = messages.next()) {
      if (message->first == done)
        return unpacked_outcome(message->second);
      const json made = json::from_msgpack(message->second);
      progress.frames = made.at(0).get<std::uint64_t>();
      progress.permille = made.at(1).get<int>();
    }
    for (; told < interrupted; ++told)
      send(socket_, interrupt, {});
  }
  return std::nullopt;
}

Outcome Worker::process(const Input& input, const Naming& naming, const Options& options, Progress& progress,
                        const std::atomic<int>& interrupted) {
  for (;;) {
    const bool used = pid_ >= 0;
    if (!input.problem.empty() || (!used && !start()))
      return process::process(input, naming, options, progress, interrupted);
    if (auto outcome = ask(input, progress, interrupted))
      return *outcome;
    const int status = stop();
    remove_parts(naming, options);
    const Loss loss = loss_of(status, input.kind == Input::Kind::file);
    if (used && !interrupted &&
        loss.cause != Cause::stalled) { // the crash may have been caused by an earlier input
      progress.frames = 0;
      progress.permille = -1;
      continue;
    }
    if (interrupted && loss.cause == Cause::stalled)
      return {Outcome::Kind::interrupted, lost(input, options, Cause::interrupted, "interrupted").record};
    return lost(input, options, loss.cause, loss.text);
  }
}

} // namespace terrainseg::process
