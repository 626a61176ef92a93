// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/worker.hpp"

#include <gst/pbutils/missing-plugins.h>

#include "exchange/counted.hpp"
#include "tools/process/container.hpp"
#include "tools/process/graph.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/source.hpp"

namespace terrainseg::process {
namespace {

using Clock = Watch::Clock;

/// Time limit for a failed source to end its stream.
constexpr std::chrono::seconds grace{2};

constexpr GstClockTime poll_interval = 20 * GST_MSECOND;
/// Waiting time after "no video" for an error with the cause. Without such an error this time is lost.
constexpr std::chrono::seconds error_delay{1};

/// Adds the image of a sequence to a fault.
Fault of_image(const std::string& image, Fault fault) {
  if (!image.empty())
    fault.text = image + ": " + fault.text;
  return fault;
}

Fault cut_off(const Input& input) {
  if (input.kind != Input::Kind::file)
    return {};
  if (const auto length = missing_length(input.path)) {
    std::error_code error;
    return {Cause::damaged,
            "the file is cut off: " + std::to_string(std::filesystem::file_size(input.path, error)) + " of " +
                std::to_string(*length) + " bytes are there"};
  }
  if (lacks_end_mark(input.path))
    return {Cause::damaged, "the file is cut off: its end mark is missing"};
  return {};
}

/// The first error of the source and of the other elements.
struct Complaints {
  Fault source;                ///< of the input
  Fault behind_source;         ///< of settings, encoders or the disk
  bool source_gave_up = false; ///< stopped without the error that has the cause
  std::string decoder_warning; ///< the first one
  std::string missing_decoder; ///< cause and remedy
};

/// Processes one input with open output files. Used by one thread.
class Run {
 public:
  Run(const Input& input, const Options& options, OutputFiles& files, Record& record, Progress& progress)
      : input_(input), options_(options), files_(files), record_(record), progress_(progress),
        source_(input, options), graph_(options), frames_(options, graph_, files[Output::csv], record) {
    graph_.build(source_.bin(), files_);
    frames_.watch(source_.bin());
    bus_.reset(gst_element_get_bus(graph_.pipeline()));
  }

  /// Runs until every sink has its EOS or an error occurs. Throws a fault when the user interrupts.
  void play(const std::atomic<int>& interrupted);
  /// `state`: that of the input before it was read.
  Outcome conclude(const std::string& state);

 private:
  void take_messages(GstClockTime timeout);
  void take_error(GstMessage* message);
  void take_warning(GstMessage* message);
  bool watch_source(Clock::duration still, bool interrupted);
  void end_source();
  void update_progress();
  void check_counts() const;
  Fault broken_promise() const;
  Fault why_empty() const;
  Fault damage() const;

  const Input& input_;
  const Options& options_;
  OutputFiles& files_;
  Record& record_;
  Progress& progress_;
  Source source_;
  Graph graph_; ///< must be destroyed (and stop the source) before the source
  Frames frames_;
  BusPointer bus_;
  Complaints complaints_;
  gint64 duration_ = -1;
  bool asked_to_end_ = false; ///< the source
  Watch watch_;               ///< of the frames
};

/// Waits at most `timeout` for a message, then processes all pending ones.
void Run::take_messages(GstClockTime timeout) {
  constexpr auto wanted =
      static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING | GST_MESSAGE_ELEMENT);
  while (const MessagePointer message{gst_bus_timed_pop_filtered(bus_.get(), timeout, wanted)}) {
    timeout = 0;
    if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR)
      take_error(message.get());
    else if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_WARNING)
      take_warning(message.get());
    else if (gst_is_missing_plugin_message(message.get()) && complaints_.missing_decoder.empty())
      complaints_.missing_decoder = no_decoder(message.get());
  }
}

/// An element without a parent belongs to the source: uridecodebin removes elements while it stops.
void Run::take_error(GstMessage* message) {
  Fault &source = complaints_.source, &behind = complaints_.behind_source;
  if (graph_.holds(message->src)) {
    if (behind)
      return;
    const auto output = graph_.output_of(message->src);
    behind = {cause_behind_source(message, output.has_value()), text_of(message)};
    if (output && (behind.cause == Cause::disk || behind.cause == Cause::unwritable))
      behind.text = "cannot write " + Naming(options_, input_).output(*output).string() + ": " + behind.text;
    return;
  }
  if (source)
    return;
  const bool gave_up = complaints_.source_gave_up = says_nothing(message);
  source = {cause_in_source(message), gave_up ? giving_up(message) : text_of(message)};
  if (gave_up && source.cause == Cause::missing)
    source.text = "it cannot be reached or read: " + source.text;
}

/// Without repetitions: several outputs use the same metadata.
void Run::take_warning(GstMessage* message) {
  const ErrorPointer error = error_in(message);
  if (!graph_.holds(message->src) && complaints_.decoder_warning.empty() && error->domain == GST_STREAM_ERROR)
    complaints_.decoder_warning = text_of(message);
  constexpr std::size_t most_warnings = 16; // a stream that changes its size may warn each time
  std::vector<std::string>& known = record_.warnings;
  // Of this project's elements only: those warnings are about settings and pictures.
  if (factory_of(message->src).starts_with("terrain") && known.size() < most_warnings &&
      std::ranges::count(known, error->message) == 0)
    known.emplace_back(error->message);
}

void Run::update_progress() {
  ++progress_.answers;
  progress_.frames = frames_.labelled();
  std::uint64_t done = frames_.position(), whole = 0;
  if (options_.max_frames || input_.kind == Input::Kind::images) {
    done = frames_.labelled();
    whole = input_.images.empty() ? options_.max_frames : input_.images.size();
    if (options_.max_frames)
      whole = std::min(whole, options_.max_frames);
  } else {
    if (duration_ <= 0)
      gst_element_query_duration(source_.bin(), GST_FORMAT_TIME, &duration_);
    whole = static_cast<std::uint64_t>(std::max<gint64>(duration_, 0));
  }
  if (whole)
    progress_.permille =
        static_cast<int>(std::min<std::uint64_t>(gst_util_uint64_scale(done, 1000, whole), 1000));
}

void Run::end_source() {
  asked_to_end_ = true;
  source_.end();
}

/// Handles a source that failed, stalled or was interrupted. `still`: time without a frame. Returns false if
/// nothing more will come.
bool Run::watch_source(Clock::duration still, bool interrupted) {
  const bool none_yet = frames_.labelled() == 0;
  const bool has_failed = complaints_.source || source_.fault();
  const bool quiet = still > grace;
  if (has_failed && none_yet && (!source_.has_video() || quiet))
    return false;
  if (!asked_to_end_ && !none_yet && (interrupted || (has_failed && quiet)))
    end_source();
  if (quiet && source_.has_given_up())
    return false;
  if (still <= std::chrono::seconds(options_.stall_seconds))
    return true;
  if (!complaints_.source)
    complaints_.source = {input_.kind == Input::Kind::uri ? Cause::missing : Cause::stalled,
                          "no frame came for " + std::to_string(options_.stall_seconds) +
                              " s (--stall-timeout): the decoder hangs or its source gives nothing"};
  if (asked_to_end_ || none_yet)
    return false;
  watch_ = {};
  end_source();
  return true;
}

void Run::play(const std::atomic<int>& interrupted) {
  ++progress_.answers;
  if (gst_element_set_state(graph_.pipeline(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE) {
    take_messages(0);
    if (!complaints_.source && !complaints_.behind_source)
      complaints_.behind_source = {Cause::resources, "the pipeline does not start"};
    return;
  }
  watch_ = {};
  while (!graph_.ended() && !complaints_.behind_source) {
    take_messages(poll_interval);
    update_progress();
    const auto still = watch_.unchanged(frames_.labelled() + graph_.written());
    // A live stream ends with the first interruption. A file is then incomplete.
    if (interrupted && (input_.kind != Input::Kind::uri || interrupted > 1 || frames_.labelled() == 0))
      throw Fault{Cause::interrupted, "interrupted"};
    if (!watch_source(still, interrupted > 0)) {
      // The error with the cause may arrive late on a busy machine.
      for (const auto until = Clock::now() + error_delay; !complaints_.source && Clock::now() < until;)
        take_messages(poll_interval);
      return;
    }
  }
  // All sinks have their EOS. Stopping waits for their last writes and errors.
  gst_element_set_state(graph_.pipeline(), GST_STATE_READY);
  take_messages(0);
}

/// Each output must have all frames; otherwise none is kept.
void Run::check_counts() const {
  const std::uint64_t frames = frames_.labelled();
  std::string text;
  if (frames_.without_metadata() > 0)
    text = counted(frames_.without_metadata(), "frame") + " came without metadata out of terrainseg";
  for (const Output kind : options_.outputs())
    if (const std::uint64_t written = graph_.written(kind); text.empty() && written != frames)
      text = std::string(names_of(kind).name) + " holds " + std::to_string(written) + " of " +
             counted(frames, "frame");
  const Fault& error = complaints_.source;
  if (!text.empty())
    throw error ? Fault{error.cause, error.text + "; " + text} : Fault{Cause::resources, text};
}

/// Fewer frames or a shorter duration than the container specifies.
Fault Run::broken_promise() const {
  if (const std::uint64_t promised = source_.promised(); record_.frames < promised)
    return {Cause::damaged, "only " + std::to_string(record_.frames) + " of the " +
                                counted(promised, "frame") + " that the file lists came out of it"};
  constexpr gint64 slack = GST_SECOND; // the last frame may have a long duration, and headers are rounded
  if (input_.kind != Input::Kind::file || !source_.other_streams().empty() || !tells_duration(input_.path) ||
      duration_ <= static_cast<gint64>(frames_.end()) + slack)
    return {};
  const auto seconds = [](gint64 time) {
    return number_text("%.1f", static_cast<double>(time) / GST_SECOND);
  };
  return {Cause::damaged, "the file says that it lasts " + seconds(duration_) +
                              " s, and its frames end after " + seconds(static_cast<gint64>(frames_.end())) +
                              " s"};
}

/// Why there was no frame.
Fault Run::why_empty() const {
  const Fault& error = complaints_.source;
  const bool failed = bool(error);
  if (!complaints_.missing_decoder.empty())
    return {Cause::unsupported, complaints_.missing_decoder};
  if (Fault fault = source_.fault(); fault && (fault.text != no_video || !failed))
    return fault;
  if (!source_.has_video() && !source_.other_streams().empty())
    return {Cause::unsupported, "there is no video in it, only " + source_.other_streams()};
  if (Fault cut = cut_off(input_)) {
    cut.text += failed ? "; " + error.text : "";
    return cut;
  }
  if (!failed) {
    const std::string listed = source_.listed();
    return listed.empty() ? Fault{Cause::unsupported, no_video} : Fault{Cause::damaged, listed};
  }
  Fault fault = of_image(source_.image_after(0), error);
  if (complaints_.source_gave_up && fault.cause == Cause::damaged)
    fault.text += std::string("; ") + make_it_anew;
  return fault;
}

/// What is wrong with an input that gave frames. No cause: it is complete.
Fault Run::damage() const {
  const auto damaged = [](const std::string& text) { return Fault{Cause::damaged, text}; };
  const std::string image = source_.image_after(record_.frames);
  if (Fault fault = source_.fault())
    return fault;
  if (complaints_.source)
    return of_image(image, complaints_.source);
  if (options_.max_frames && record_.frames >= options_.max_frames)
    return {};
  const std::string& warning = complaints_.decoder_warning;
  if (!image.empty())
    return damaged(image + ": it could not be decoded" + (warning.empty() ? "" : ": " + warning));
  if (Fault cut = cut_off(input_))
    return cut;
  if (!warning.empty())
    return damaged(warning);
  if (const std::uint64_t lost = source_.lost(); lost > 0)
    return damaged(counted(lost, "frame") + " in it could not be decoded");
  if (const std::string cut = source_.cut_images(); !cut.empty())
    return damaged(cut);
  if (source_.corrupted() > 0)
    return damaged("the decoder marked " + counted(source_.corrupted(), "frame") + " as damaged");
  return broken_promise();
}

Outcome Run::conclude(const std::string& state) {
  gst_element_set_state(graph_.pipeline(), GST_STATE_NULL);
  update_progress();
  progress_.answers = 0;
  record_.frames = frames_.labelled();
  if (const std::string choice = source_.choice(); !choice.empty())
    record_.warnings.push_back(choice);
  record_.still_rows = frames_.still_rows();
  g_autoptr(GstStructure) stats = nullptr;
  g_object_get(graph_.terrainseg(), "stats", &stats, nullptr);
  double microseconds = 0;
  if (stats && gst_structure_get_double(stats, "total-median-us", &microseconds))
    record_.filter_milliseconds = microseconds / 1000;
  if (complaints_.behind_source)
    throw complaints_.behind_source;
  const Fault changed{Cause::changed, "it was written to or replaced while it was read"};
  const bool is_changed = input_.state() != state;
  if (record_.frames == 0)
    throw is_changed ? changed : why_empty();
  if (const std::string metadata = graph_.bag_metadata(); !metadata.empty()) {
    files_[Output::bag].write(metadata);
    graph_.count(Output::bag, graph_.written(Output::mcap));
  }
  check_counts();
  record_.fault = is_changed ? changed : damage();
  record_.fault.text = without_credentials(record_.fault.text);
  for (std::string& warning : record_.warnings)
    warning = without_credentials(warning);
  files_.keep(record_);
  return {record_.fault ? Outcome::Kind::partial : Outcome::Kind::complete, record_};
}

} // namespace

Outcome failed(Record record, const Fault& fault) {
  record.fault = {fault.cause, without_credentials(fault.text)};
  return {fault.cause == Cause::interrupted ? Outcome::Kind::interrupted : Outcome::Kind::failed,
          std::move(record)};
}

Outcome process(const Input& input, const Options& options, Progress& progress,
                const std::atomic<int>& interrupted) {
  Record record;
  record.input = input.label;
  try {
    if (input.fault)
      throw input.fault;
    const std::string state = input.state(); // before its identity is read
    record = record_of(input, options);
    OutputFiles files(input, options);
    Run run(input, options, files, record, progress);
    const auto begin = Clock::now();
    run.play(interrupted);
    record.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    return run.conclude(state);
  } catch (const Fault& fault) {
    return failed(record, fault);
  } catch (const std::exception& error) {
    return failed(record, {Cause::resources, error.what()});
  }
}

} // namespace terrainseg::process
