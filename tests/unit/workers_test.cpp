// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/workers.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <new>
#include <pthread.h>

namespace {

using terrainseg::Workers;

TEST(Workers, EveryTaskRunsOnceForAnyCount) {
  for (const int threads : {1, 2, 3, 16}) {
    Workers workers(threads);
    EXPECT_EQ(workers.count(), threads);
    for (int tasks = 0; tasks <= 40; ++tasks) {
      std::array<std::atomic<int>, 40> ran{};
      workers.run(tasks, [&](int task) { ++ran[static_cast<std::size_t>(task)]; });
      for (int i = 0; i < 40; ++i)
        ASSERT_EQ(ran[static_cast<std::size_t>(i)], i < tasks ? 1 : 0) << threads << " threads, task " << i;
    }
  }
}

TEST(Workers, WhatTasksWroteIsSeenAfterwards) {
  Workers workers(4);
  std::array<std::uint64_t, 8> sums{}; // not atomic: run() itself must order the writes
  for (std::uint64_t round = 1; round <= 2000; ++round) {
    workers.run(8, [&](int task) { sums[static_cast<std::size_t>(task)] += round; });
    for (const std::uint64_t s : sums)
      ASSERT_EQ(s, round * (round + 1) / 2);
  }
}

TEST(Workers, AnExceptionOfATaskReachesTheCallerAfterAllTasks) {
  for (const int threads : {1, 3}) {
    Workers workers(threads);
    for (int round = 0; round < 200; ++round) {
      std::atomic<int> ended{0};
      EXPECT_THROW(workers.run(7,
                               [&](int task) {
                                 if (task == round % 7)
                                   throw std::bad_alloc();
                                 ++ended;
                               }),
                   std::bad_alloc);
      EXPECT_EQ(ended, threads == 1 ? round % 7 : 6);
      ended = 0;
      workers.run(7, [&](int) { ++ended; }); // the next run knows nothing of it
      EXPECT_EQ(ended, 7);
    }
  }
}

TEST(Workers, ZeroMeansTheProcessorsThereAre) {
  const Workers workers(0);
  EXPECT_GE(workers.count(), 1);
  EXPECT_LE(workers.count(), 8);
}

// No thread of this size can be had: the caller works alone, as it would with one thread.
TEST(Workers, ThreadsThatCannotStartAreDoneWithout) {
  pthread_attr_t usual, endless;
  ASSERT_EQ(pthread_getattr_default_np(&usual), 0);
  pthread_attr_init(&endless);
  ASSERT_EQ(pthread_attr_setstacksize(&endless, std::size_t{1} << 47), 0);
  ASSERT_EQ(pthread_setattr_default_np(&endless), 0);
  {
    Workers workers(4);
    EXPECT_EQ(workers.count(), 1);
    int ran = 0;
    workers.run(7, [&](int) { ++ran; });
    EXPECT_EQ(ran, 7);
  }
  EXPECT_EQ(pthread_setattr_default_np(&usual), 0);
  EXPECT_EQ(Workers(3).count(), 3);
}

TEST(Workers, ManyCanLiveAtOnceAndEndUnused) {
  std::array<Workers, 3> workers;
  Workers a(3), b(2);
  std::atomic<int> n{0};
  a.run(5, [&](int) { ++n; });
  EXPECT_EQ(n, 5);
}

} // namespace
