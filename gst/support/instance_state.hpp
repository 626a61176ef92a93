// SPDX-License-Identifier: LGPL-2.1-or-later
// The C++ state of an element inside the memory of its GObject: an instance's init has no way to fail, so it
// must not allocate.
#pragma once

#include <glib-object.h>

#include <memory>
#include <new>
#include <type_traits>

namespace terrainseg {

/// Member `state` of an instance struct: a State in the instance's own memory. GObject zeroes that and runs
/// no constructor: make() belongs into init, finalize_state() into the class.
template <class State> class InstanceState {
 public:
  void make() noexcept {
    static_assert(std::is_nothrow_default_constructible_v<State>, "an exception in init ends the program");
    static_assert(sizeof(State) <= 32768, "GObject counts the size of an instance in 16 bits");
    new (bytes_) State;
  }
  State& operator*() noexcept { return *std::launder(reinterpret_cast<State*>(bytes_)); }
  State* operator->() noexcept { return &**this; }

 private:
  alignas(State) unsigned char bytes_[sizeof(State)];
};

/// Finalize of such a class; `parent_class` is what G_DEFINE_TYPE makes.
template <class Instance, gpointer& parent_class> void finalize_state(GObject* object) {
  std::destroy_at(&*reinterpret_cast<Instance*>(object)->state);
  G_OBJECT_CLASS(parent_class)->finalize(object);
}

} // namespace terrainseg
