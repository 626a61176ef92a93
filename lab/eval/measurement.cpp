// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/measurement.hpp"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "exchange/counted.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/parallel.hpp"

namespace terrainseg::eval {
namespace {

Answer show(Engine& engine, const Sequence& sequence, const Sample& sample, std::size_t index) {
  Answer answer;
  for (int i = 0; i < sequence.repeat; ++i)
    answer = engine.look(sample.picture, index);
  return answer;
}

/// Whether things are counted in the `number`th scored frame of a run.
bool counts_things(const Sequence& sequence, std::size_t number) {
  return sequence.things_every > 0 && number % static_cast<std::size_t>(sequence.things_every) == 0;
}

} // namespace

std::vector<Sample> read_all(const Sequence& sequence) {
  std::vector<Sample> samples(sequence.size());
  for_each_in_parallel(samples.size(), [&](std::size_t i, std::size_t) { samples[i] = sequence.read(i); });
  return samples;
}

std::vector<cv::Mat1b> labels_of(const std::vector<Sample>& samples) {
  std::vector<cv::Mat1b> labels;
  labels.reserve(samples.size());
  for (const Sample& s : samples)
    labels.push_back(s.labels);
  return labels;
}

Figures measure(const Sequence& sequence, const std::vector<Sample>& samples, const std::string& engine,
                const std::string& input, std::vector<cv::Mat1b>* masks) {
  tune(engine);
  const std::size_t length = sequence.run_length(), runs = (samples.size() + length - 1) / length;
  const std::vector<cv::Mat1b> labels = labels_of(samples);
  std::vector<std::unique_ptr<Engine>> engines(worker_count(runs));
  std::vector<Scorer> scorers(runs, Scorer(sequence.name, engine, input));
  if (masks)
    masks->resize(samples.size());
  for_each_in_parallel(runs, [&](std::size_t run, std::size_t worker) {
    std::unique_ptr<Engine>& own = engines[worker];
    if (own)
      own->forget();
    else
      own = make_engine(engine, sequence, labels);
    for (std::size_t i = run * length, k = 0; i < std::min(samples.size(), (run + 1) * length); ++i) {
      const Answer answer = show(*own, sequence, samples[i], i);
      if (!sequence.is_scored(i))
        continue;
      scorers[run].add(answer, labels[i], i, counts_things(sequence, k++));
      if (masks)
        (*masks)[i] = answer.mask;
    }
  });
  Scorer all(sequence.name, engine, input);
  for (Scorer& s : scorers)
    all.join(std::move(s));
  Figures figures = all.finish();
  if (figures.frames.empty())
    throw std::runtime_error(sequence.folder + ": " + counted(samples.size(), "frame") +
                             ", of which none is scored: take more frames");
  figures.stills = sequence.stills;
  figures.kind = sequence.kind;
  return figures;
}

} // namespace terrainseg::eval
