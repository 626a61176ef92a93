// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/verdict.hpp"

#include "exchange/counted.hpp"
#include "tools/process/container.hpp"
#include "tools/process/reasons.hpp"

namespace terrainseg::process {
namespace {

/// Adds the image of a sequence to a fault.
Fault of_image(const std::string& image, Fault fault) {
  if (!image.empty())
    fault.text = image + ": " + fault.text;
  return fault;
}

Fault changed_meanwhile() {
  return {Cause::changed, "it was written to or replaced while it was read"};
}

/// Fewer frames or a shorter duration than the container specifies.
Fault broken_promise(const Ended& run) {
  if (const std::uint64_t promised = run.source.promised(); run.frames < promised)
    return {Cause::damaged, "only " + std::to_string(run.frames) + " of the " + counted(promised, "frame") +
                                " that the file lists came out of it"};
  constexpr gint64 slack = GST_SECOND; // the last frame may have a long duration, and headers are rounded
  if (run.input.kind != Input::Kind::file || !run.source.other_streams().empty() ||
      !tells_duration(run.input.path) || run.duration <= static_cast<gint64>(run.end) + slack)
    return {};
  const auto seconds = [](gint64 time) {
    char text[G_ASCII_DTOSTR_BUF_SIZE];
    return std::string(g_ascii_formatd(text, sizeof text, "%.1f", static_cast<double>(time) / GST_SECOND));
  };
  return {Cause::damaged, "the file says that it lasts " + seconds(run.duration) +
                              " s, and its frames end after " + seconds(static_cast<gint64>(run.end)) + " s"};
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

} // namespace

Fault why_empty(const Ended& run) {
  if (run.changed)
    return changed_meanwhile();
  const Fault& error = run.complaints.source();
  const bool failed = error.cause != Cause::none;
  if (!run.complaints.missing_decoder().empty())
    return {Cause::unsupported, run.complaints.missing_decoder()};
  if (const std::string problem = run.source.problem(); !problem.empty() && (problem != no_video || !failed))
    return {run.source.cause(), problem};
  if (!run.source.has_video() && !run.source.other_streams().empty())
    return {Cause::unsupported, "there is no video in it, only " + run.source.other_streams()};
  if (Fault cut = cut_off(run.input); cut.cause != Cause::none) {
    cut.text += failed ? "; " + error.text : "";
    return cut;
  }
  if (!failed) {
    const std::string listed = run.source.listed();
    return listed.empty() ? Fault{Cause::unsupported, no_video} : Fault{Cause::damaged, listed};
  }
  Fault fault = of_image(run.source.image_after(0), error);
  if (run.complaints.source_gave_up() && fault.cause == Cause::damaged)
    fault.text += std::string("; ") + make_it_anew;
  return fault;
}

Fault damage_of(const Ended& run) {
  const auto damaged = [](const std::string& text) { return Fault{Cause::damaged, text}; };
  if (run.changed)
    return changed_meanwhile();
  const std::string image = run.source.image_after(run.frames);
  if (!run.source.problem().empty())
    return {run.source.cause(), run.source.problem()};
  if (run.complaints.source().cause != Cause::none)
    return of_image(image, run.complaints.source());
  if (run.options.max_frames && run.frames >= run.options.max_frames)
    return {};
  const std::string& warning = run.complaints.decoder_warning();
  if (!image.empty())
    return damaged(image + ": it could not be decoded" + (warning.empty() ? "" : ": " + warning));
  if (Fault cut = cut_off(run.input); cut.cause != Cause::none)
    return cut;
  if (!warning.empty())
    return damaged(warning);
  if (const std::uint64_t lost = run.source.lost(); lost > 0)
    return damaged(counted(lost, "frame") + " in it could not be decoded");
  if (const std::string cut = run.source.cut_images(); !cut.empty())
    return damaged(cut);
  if (run.source.corrupted() > 0)
    return damaged("the decoder marked " + counted(run.source.corrupted(), "frame") + " as damaged");
  return broken_promise(run);
}

} // namespace terrainseg::process
