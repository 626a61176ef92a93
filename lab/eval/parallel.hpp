// SPDX-License-Identifier: LGPL-2.1-or-later
// Work on as many processors as there are.
#pragma once

#include <cstddef>
#include <functional>

namespace terrainseg::eval {

/// Calls work(item, worker) once for each item in 0..count - 1; worker is a number in 0..worker_count(count)
/// - 1 that no other call has at the same time. Throws the first exception that a call threw.
void for_each_in_parallel(std::size_t count,
                          const std::function<void(std::size_t item, std::size_t worker)>& work);

/// How many calls run at once: a processor each, and no more than `count`; at least 1.
std::size_t worker_count(std::size_t count);

} // namespace terrainseg::eval
