// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/shard.hpp"

#include <glib.h>

#include <charconv>
#include <optional>
#include <string_view>

#include "tools/command_line.hpp"

namespace terrainseg::process {
namespace {

std::optional<int> read_number(std::string_view text) {
  int value = 0;
  const auto [stopped, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || stopped != text.data() + text.size() || value < 0)
    return std::nullopt;
  return value;
}

std::optional<int> variable(const char* name) {
  const char* text = g_getenv(name);
  return text ? read_number(text) : std::nullopt;
}

Shard from_environment() {
  const auto fixed = variable("TERRAINSEG_SHARD_COUNT");
  if (const auto id = variable("SLURM_ARRAY_TASK_ID")) {
    const auto first = variable("SLURM_ARRAY_TASK_MIN"), count = variable("SLURM_ARRAY_TASK_COUNT");
    const int step = std::max(variable("SLURM_ARRAY_TASK_STEP").value_or(1), 1);
    if (!first || !count)
      throw tools::UsageError("--shard auto: SLURM_ARRAY_TASK_ID is set, but not SLURM_ARRAY_TASK_MIN and "
                              "SLURM_ARRAY_TASK_COUNT");
    return Shard{(*id - *first) / step + 1, fixed.value_or(*count)};
  }
  if (const auto index = variable("JOB_COMPLETION_INDEX")) {
    if (!fixed)
      throw tools::UsageError(
          "--shard auto: JOB_COMPLETION_INDEX is set, but TERRAINSEG_SHARD_COUNT, the Job's completions, "
          "is not");
    return Shard{*index + 1, *fixed};
  }
  throw tools::UsageError(
      "--shard auto: neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set; is this an array task?");
}

/// Evenly distributed in 0..count-1: the first 8 bytes of the SHA-256 of the path as given.
int shard_of(const Input& input, int count) {
  const std::string written = input.kind == Input::Kind::uri
                                  ? input.label
                                  : std::filesystem::path(input.label).lexically_normal().string();
  guint8 digest[32];
  gsize length = sizeof digest;
  GChecksum* sum = g_checksum_new(G_CHECKSUM_SHA256);
  g_checksum_update(sum, reinterpret_cast<const guchar*>(written.data()),
                    static_cast<gssize>(written.size()));
  g_checksum_get_digest(sum, digest, &length);
  g_checksum_free(sum);
  std::uint64_t value = 0;
  for (int i = 0; i < 8; ++i)
    value = value << 8 | digest[i];
  return static_cast<int>(value % static_cast<unsigned>(count));
}

} // namespace

Shard read_shard(const std::string& text) {
  const auto written = [all = std::string_view(text)] {
    const std::size_t slash = all.find('/');
    const auto index = read_number(all.substr(0, slash)),
               count = slash == all.npos ? std::nullopt : read_number(all.substr(slash + 1));
    if (!index || !count)
      throw tools::UsageError("--shard: '" + std::string(all) + "' is neither I/N, such as 1/4, nor auto");
    return Shard{*index, *count};
  };
  const Shard shard = text == "auto" ? from_environment() : written();
  if (shard.index < 1 || shard.index > shard.count || shard.count > most_shards)
    throw tools::UsageError("--shard: " + std::to_string(shard.index) + "/" + std::to_string(shard.count) +
                            " is not one of 1/N to N/N with N up to 1000000");
  return shard;
}

std::vector<Input> share_of(const Shard& shard, std::vector<Input> inputs) {
  std::erase_if(inputs,
                [&shard](const Input& input) { return shard_of(input, shard.count) != shard.index - 1; });
  return inputs;
}

} // namespace terrainseg::process
