// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/worker.hpp"

#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <future>
#include <memory>
#include <nlohmann/json.hpp>
#include <tuple>
#include <utility>

#include "exchange/write_all.hpp"

extern char** environ;

namespace terrainseg::process {

// The messages' fields. File names are bytes, which MessagePack takes as they are.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Fault, cause, text)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Identity, bytes, fingerprint)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Input, kind, label, stem, path, images, fault)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Record::Written, file, bytes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Record, input, place, identity, settings, fault, frames, width, height,
                                   seconds, traversable_sum, blocked, horizon_frames, filter_milliseconds,
                                   still_rows, warnings, outputs)
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

constexpr int tick = 100; // interval of checking signals and progress, milliseconds

/// Exit code of a worker whose pipeline hangs.
constexpr int hangs = 124;
/// Time limit of a pipeline that the user interrupted.
constexpr std::chrono::seconds interrupted_limit{10};

/// Content of a message on the progress: frames and permille.
using FramesDone = std::pair<std::uint64_t, int>;

/// Kind of a message: its first byte.
enum Kind : char { work = 'w', interrupt = 'i', progress_made = 'p', done = 'd' };

/// Messages have a length in front. If the other end is closed, a message is lost; the reader detects that.
void send(int socket, Kind kind, const std::string& content) {
  const std::uint32_t length = static_cast<std::uint32_t>(content.size() + 1);
  std::string bytes(reinterpret_cast<const char*>(&length), sizeof length);
  bytes += static_cast<char>(kind);
  bytes += content;
  write_all(socket, {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

class Messages {
 public:
  /// `event`: another descriptor that ends a wait; -1 = none.
  explicit Messages(int socket, int event = -1) : socket_(socket), event_(event) {}
  /// Waits at most a tick for data. Returns false if the other end is closed.
  bool receive() {
    pollfd what[] = {{socket_, POLLIN, 0}, {event_, POLLIN, 0}};
    if (poll(what, 2, tick) <= 0 || what[0].revents == 0)
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
  int socket_, event_;
  std::string bytes_;
};

/// Removes the unfinished files of a crashed worker. Opening them takes their locks, and deletes them at the
/// end.
void remove_parts(const Input& input, const Options& options) {
  try {
    const OutputFiles parts(input, options);
  } catch (const Fault&) { // another run has taken the name
  }
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

/// If the run has ended, the worker exits at once: unfinished files remain as after a power failure.
/// quick_exit() skips destructors, because the thread of an input may hold locks.
void serve(int socket, const Options& options) {
  const int finish = eventfd(0, EFD_CLOEXEC);
  Messages messages(socket, finish);
  std::atomic<int> interrupted{0};
  std::unique_ptr<Progress> progress; // of the current input
  std::future<Outcome> outcome;
  std::uint64_t told_frames = 0;
  Watch watch;
  while (messages.receive()) {
    while (const auto message = messages.next()) {
      if (message->first == interrupt) {
        ++interrupted;
        continue;
      }
      forget_the_log();
      progress = std::make_unique<Progress>();
      // Where the system has no thread left, outcome.get() does the work.
      outcome = std::async([&, input = unpacked<Input>(message->second)] {
        Outcome result = process(input, options, *progress, interrupted);
        eventfd_write(finish, 1);
        return result;
      });
    }
    const bool is_finished =
        progress && outcome.wait_for(std::chrono::seconds(0)) != std::future_status::timeout;
    if (progress && progress->frames != told_frames) {
      told_frames = progress->frames;
      send(socket, progress_made, packed(FramesDone(told_frames, progress->permille)));
    }
    if (is_finished) {
      send(socket, done, packed(outcome.get()));
      eventfd_t count = 0;
      eventfd_read(finish, &count);
      progress.reset();
    }
    // An element may not return from a call, such as the one that stops it.
    const std::uint64_t answers = progress ? progress->answers.load() : 0;
    const auto unanswered = watch.unchanged(answers);
    const std::chrono::seconds limit(options.stall_seconds);
    if (answers > 0 && unanswered > (interrupted ? std::min(limit, interrupted_limit) : limit))
      std::quick_exit(hangs);
  }
  std::quick_exit(0);
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
    if (input.fault || (!used && !start()))
      return process::process(input, options, progress, interrupted);
    if (auto outcome = ask(input, progress, interrupted))
      return *outcome;
    const int status = stop();
    remove_parts(input, options);
    Fault loss = loss_of(status, input.kind == Input::Kind::file);
    if (used && !interrupted && loss.cause != Cause::stalled) { // an earlier input may have caused the crash
      progress.frames = 0;
      progress.permille = -1;
      continue;
    }
    if (interrupted && loss.cause == Cause::stalled)
      loss = {Cause::interrupted, "interrupted"};
    return failed(record_of(input, options), loss);
  }
}

} // namespace terrainseg::process
