// SPDX-License-Identifier: LGPL-2.1-or-later
// The C++ state of an element inside the memory of its GObject: an instance's init has no way to fail, so it
// must not allocate.
#pragma once

#include <memory>
#include <new>
#include <type_traits>

namespace terrainseg {

/// Member of an instance struct: room for a State. GObject zeroes it and runs no constructor. make() belongs
/// into init, std::destroy_at() into finalize.
template <class State> class InstanceMemory {
 public:
  State* make() noexcept {
    static_assert(std::is_nothrow_default_constructible_v<State>, "an exception in init ends the program");
    static_assert(sizeof(State) <= 32768, "GObject counts the size of an instance in 16 bits");
    return new (bytes_) State;
  }

 private:
  alignas(State) unsigned char bytes_[sizeof(State)];
};

} // namespace terrainseg
