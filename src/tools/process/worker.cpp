// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/worker.hpp"

#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <tuple>
#include <utility>

#include "exchange/write_all.hpp"

extern char** environ;

namespace terrainseg::process {

// The messages' fields. File names are bytes, which MessagePack takes as they are.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Identity, bytes, fingerprint)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Input, kind, label, stem, path, images, problem, cause)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Record::Written, file, bytes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Record, input, place, identity, settings, problem, cause, frames, width,
                                   height, seconds, traversable_sum, blocked, horizon_frames,
                                   filter_milliseconds, still_rows, warnings, outputs)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Outcome, kind, record)

template <typename Value> std::string packed(const Value& value) {
  std::string bytes;
  nlohmann::json::to_msgpack(value, bytes);
  return bytes;
}

template <typename Value> Value unpacked(const std::string& bytes) {
  return nlohmann::json::from_msgpack(bytes).get<Value>();
}

template std::string packed(const Input&);
template std::string packed(const Outcome&);
template Input unpacked(const std::string&);
template Outcome unpacked(const std::string&);

namespace {

namespace fs = std::filesystem;

constexpr int tick = 100; // interval of checking signals and progress, milliseconds

/// Exit code of a worker whose pipeline hangs.
constexpr int hangs = 124;
/// Time limit of a pipeline that the user interrupted.
constexpr std::chrono::seconds interrupted_limit{10};

/// Content of a message on the progress: frames and permille.
using FramesDone = std::pair<std::uint64_t, int>;

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

Outcome lost(const Input& input, const Options& options, const Fault& fault) {
  Outcome outcome;
  outcome.record.input = input.label;
  outcome.record.place = input.place();
  outcome.record.identity = input.identity();
  outcome.record.settings = describe(options, input);
  outcome.record.cause = fault.cause;
  outcome.record.problem = fault.text;
  return outcome;
}

/// Removes the unfinished files of a crashed worker. Opening a file takes its lock, and deletes it at the
/// end.
void remove_parts(const Input& input, const Options& options) {
  const Naming naming(options, input);
  AtomicFile record;
  try {
    record.open(naming.record());
  } catch (const Fault&) { // another run has taken the name
    return;
  }
  for (const Output kind : options.outputs())
    try {
      const fs::path path = naming.output(kind);
      AtomicFile().open(path);
      std::error_code error; // the folder of a recording is not removed if it contains other files
      if (path.parent_path() != naming.record().parent_path())
        fs::remove(path.parent_path(), error);
    } catch (const Fault&) { // it was not made
    }
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
    const Outcome outcome = process(input, options_, progress, interrupted_);
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
        input_ = unpacked<Input>(message->second);
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
  send(socket_, progress_made, packed(FramesDone(told_frames_, progress_->permille)));
}

} // namespace

Fault loss_of(int status, bool file) {
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
        return unpacked<Outcome>(message->second);
      std::tie(progress.frames, progress.permille) = unpacked<FramesDone>(message->second);
    }
    for (; told < interrupted; ++told)
      send(socket_, interrupt, {});
  }
  return std::nullopt;
}

Outcome Worker::process(const Input& input, const Options& options, Progress& progress,
                        const std::atomic<int>& interrupted) {
  for (;;) {
    const bool used = pid_ >= 0;
    if (!input.problem.empty() || (!used && !start()))
      return process::process(input, options, progress, interrupted);
    if (auto outcome = ask(input, progress, interrupted))
      return *outcome;
    const int status = stop();
    remove_parts(input, options);
    const Fault loss = loss_of(status, input.kind == Input::Kind::file);
    if (used && !interrupted && loss.cause != Cause::stalled) { // an earlier input may have caused the crash
      progress.frames = 0;
      progress.permille = -1;
      continue;
    }
    if (interrupted && loss.cause == Cause::stalled)
      return {Outcome::Kind::interrupted, lost(input, options, {Cause::interrupted, "interrupted"}).record};
    return lost(input, options, loss);
  }
}

} // namespace terrainseg::process
