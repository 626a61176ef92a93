// SPDX-License-Identifier: LGPL-2.1-or-later
// What every element needs: its C++ state, its properties, and calls that may throw.
#pragma once

#include <gst/gst.h>

#include <exception>
#include <memory>
#include <new>
#include <type_traits>

#include "support/properties.hpp"

namespace terrainseg {

/// The name of an element for users: its factory's, or its type's for a derived class without a factory.
inline const char* name_of_kind(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  return factory ? gst_plugin_feature_get_name(factory) : G_OBJECT_TYPE_NAME(element);
}

/// Runs `body`. If it throws (mostly out of memory), the element posts an error with the exception's text,
/// and `failed` is returned: exceptions must not leave a virtual function of GObject.
template <class Result, class Body> Result guarded(gpointer object, Result failed, Body body) {
  auto* element = GST_ELEMENT(object);
  try {
    return body();
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s failed: %s", name_of_kind(element), error.what()),
                      ("exception: %s", error.what()));
  } catch (...) {
    GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s failed", name_of_kind(element)), ("unknown exception"));
  }
  return failed;
}
/// The same for a body without a result.
template <class Body> void guarded(gpointer object, Body body) {
  guarded(object, true, [&] {
    body();
    return true;
  });
}

/// Holds the object lock for its lifetime.
class ObjectLock {
 public:
  explicit ObjectLock(gpointer object) : object_(GST_OBJECT(object)) { GST_OBJECT_LOCK(object_); }
  ~ObjectLock() { GST_OBJECT_UNLOCK(object_); }
  ObjectLock(const ObjectLock&) = delete;
  ObjectLock& operator=(const ObjectLock&) = delete;

 private:
  GstObject* object_;
};

/// A copy of what the object lock guards.
template <class Value> Value locked_copy(gpointer object, const Value& value) {
  const ObjectLock lock(object);
  return value;
}

/// The pointer for GST_PTR_FORMAT, which the compiler checks as %p.
inline void* printable(void* object) {
  return object;
}

/// The member `state` of an instance struct. GObject zeroes the memory and calls no constructor: call make()
/// in init and init_class() in class_init. The init function of an instance cannot fail, so the constructor
/// of the state must not allocate. "streaming" in a state: touched by the streaming thread alone, or while
/// there is none.
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

/// The instance struct of an element.
template <class Base, class State> struct Instance {
  Base parent;
  InstanceState<State> state;

  /// For init: makes the state, whose member `element` is the instance.
  State& make_state() noexcept {
    state.make();
    state->element = reinterpret_cast<decltype(state->element)>(this);
    return *state;
  }
  static State& state_of(gpointer object) { return *reinterpret_cast<Instance*>(object)->state; }
  /// A virtual function: calls `function` with the state instead of the object. Posts what it throws, and
  /// returns FALSE, nullptr or GST_FLOW_ERROR.
  template <auto function, class Result, class Object, class... Rest>
  static Result call(Object* object, Rest... rest) {
    const auto body = [&] { return static_cast<Result>(function(state_of(object), rest...)); };
    if constexpr (std::is_void_v<Result>)
      guarded(object, body);
    else if constexpr (std::is_same_v<Result, GstFlowReturn>)
      return guarded(object, GST_FLOW_ERROR, body);
    else
      return guarded(object, Result(), body);
  }
  /// The same as a function of a pad.
  template <auto function, class Result, class... Rest>
  static Result pad_call(GstPad*, GstObject* parent, Rest... rest) {
    return call<function, Result>(parent, rest...);
  }
};

/// Sets and gets the properties of `table`, whose ids begin at 1: fields of the member `settings` of the
/// state, under the object lock. GObject passes ids that are installed, and of writable ones alone to set.
template <class Self, const auto& table>
void set_in_table(GObject* object, guint id, const GValue* value, GParamSpec*) {
  const ObjectLock lock(object);
  table[id - 1].field.set(Self::state_of(object).settings, value);
}
template <class Self, const auto& table>
void get_in_table(GObject* object, guint id, GValue* value, GParamSpec*) {
  const auto& field = table[id - 1].field;
  if (field.make)
    return g_value_take_boxed(value, field.make(object));
  const ObjectLock lock(object);
  field.get(Self::state_of(object).settings, value);
}

/// Adds the template of a pad that is always there.
inline void add_pad_template(gpointer klass, const char* name, GstPadDirection direction, const char* caps,
                             GType type = GST_TYPE_PAD) {
  g_autoptr(GstCaps) parsed = gst_caps_from_string(caps);
  gst_element_class_add_pad_template(
      GST_ELEMENT_CLASS(klass),
      gst_pad_template_new_with_gtype(name, direction, GST_PAD_ALWAYS, parsed, type));
}
/// Adds the pad of such a template.
inline GstPad* add_pad(GstElement* element, const char* name) {
  GstPad* pad = gst_pad_new_from_template(gst_element_get_pad_template(element, name), name);
  gst_element_add_pad(element, pad);
  return pad;
}

/// The texts that users see of an element, all static.
struct ElementTexts {
  const char *name, *classification, *description;
};
/// Sets what every element sets of its class; `parent_class` is defined by G_DEFINE_TYPE.
template <class Self, gpointer& parent_class> void init_class(gpointer klass, const ElementTexts& texts) {
  G_OBJECT_CLASS(klass)->finalize = [](GObject* object) {
    std::destroy_at(&Self::state_of(object));
    G_OBJECT_CLASS(parent_class)->finalize(object);
  };
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), texts.name, texts.classification,
                                        texts.description, "The terrainseg developers");
}
/// And the properties of a table.
template <class Self, gpointer& parent_class, const auto& table>
void init_class(gpointer klass, const ElementTexts& texts) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_in_table<Self, table>;
  object_class->get_property = get_in_table<Self, table>;
  install_table(object_class, 1, table);
  init_class<Self, parent_class>(klass, texts);
}

} // namespace terrainseg
