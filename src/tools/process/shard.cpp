// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/shard.hpp"

#include <glib.h>

#include <charconv>
#include <cstring>
#include <optional>

namespace terrainseg::process {
namespace {

std::optional<int> read_number(const char* begin, const char* end) {
  int value = 0;
  const auto [stopped, error] = std::from_chars(begin, end, value);
  if (begin == end || error != std::errc() || stopped != end || value < 0)
    return std::nullopt;
  return value;
}

std::optional<int> variable(const char* name) {
  const char* text = g_getenv(name);
  return text ? read_number(text, text + std::strlen(text)) : std::nullopt;
}

std::variant<Shard, std::string> from_environment() {
  const auto fixed = variable("TERRAINSEG_SHARD_COUNT");
  if (const auto id = variable("SLURM_ARRAY_TASK_ID")) {
    const auto first = variable("SLURM_ARRAY_TASK_MIN"), count = variable("SLURM_ARRAY_TASK_COUNT");
    const int step = std::max(variable("SLURM_ARRAY_TASK_STEP").value_or(1), 1);
    if (!first || !count)
      return "--shard auto: SLURM_ARRAY_TASK_ID is set, but not SLURM_ARRAY_TASK_MIN and "
             "SLURM_ARRAY_TASK_COUNT";
    return Shard{(*id - *first) / step + 1, fixed.value_or(*count)};
  }
  if (const auto index = variable("JOB_COMPLETION_INDEX")) {
    if (!fixed)
      return "--shard auto: JOB_COMPLETION_INDEX is set, but TERRAINSEG_SHARD_COUNT, the Job's completions, "
             "is not";
    return Shard{*index + 1, *fixed};
  }
  return "--shard auto: neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set; is this an array task?";
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

std::variant<Shard, std::string> read_shard(const std::string& text) {
  std::variant<Shard, std::string> result;
  if (text == "auto") {
    result = from_environment();
  } else {
    const std::size_t slash = text.find('/');
    const char* begin = text.data();
    const char* end = begin + text.size();
    const auto index = slash == std::string::npos ? std::nullopt : read_number(begin, begin + slash);
    const auto count = slash == std::string::npos ? std::nullopt : read_number(begin + slash + 1, end);
    if (!index || !count)
      return "--shard: '" + text + "' is neither I/N, such as 1/4, nor auto";
    result = Shard{*index, *count};
  }
  if (const Shard* shard = std::get_if<Shard>(&result))
    if (shard->index < 1 || shard->index > shard->count || shard->count > most_shards)
      return "--shard: " + std::to_string(shard->index) + "/" + std::to_string(shard->count) +
             " is not one of 1/N to N/N with N up to 1000000";
  return result;
}

std::vector<Input> share_of(const Shard& shard, std::vector<Input> inputs) {
  std::erase_if(inputs,
                [&shard](const Input& input) { return shard_of(input, shard.count) != shard.index - 1; });
  return inputs;
}

} // namespace terrainseg::process
