// SPDX-License-Identifier: LGPL-2.1-or-later
// A table of properties that are fields of a plain struct: creates their GParamSpecs, sets and gets them.
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "terrainseg/settings_table.hpp"

namespace terrainseg {

/// Can be set in any state; `controllable` can also be bound to a controller; `before_start` can be set up to
/// READY; `readable` cannot be set.
inline constexpr auto property_readable = static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS);
inline constexpr auto property_playing =
    static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
inline constexpr auto property_controllable =
    static_cast<GParamFlags>(property_playing | GST_PARAM_CONTROLLABLE);
inline constexpr auto property_before_start =
    static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);

/// The name of a terrainseg instance as an interned string, which any thread may read without a lock; "" =
/// none. Interned names are never freed; programs set only a few.
class InternedName {
 public:
  InternedName() = default;
  InternedName(const InternedName& other) : text_(other.c_str()) {}
  InternedName& operator=(const InternedName& other) { return *this = other.c_str(); }
  InternedName& operator=(const char* text) {
    text_ = *text ? g_intern_string(text) : "";
    return *this;
  }
  const char* c_str() const { return text_; }

 private:
  std::atomic<const char*> text_ = "";
};

/// Registers an enumeration with the values 0, 1, ... unless it is registered: two plugins contain this code.
inline GType choice_type(const char* name, std::span<const Choice> choices) {
  if (const GType known = g_type_from_name(name))
    return known;
  auto* values = g_new0(GEnumValue, choices.size() + 1); // a type lives as long as the process
  for (std::size_t i = 0; i < choices.size(); ++i)
    values[i] = {static_cast<gint>(i), choices[i].meaning, choices[i].nick};
  // NOLINTNEXTLINE(clang-analyzer-unix.Malloc)
  const GType type = g_enum_register_static(name, values);
  gst_type_mark_as_plugin_api(type, static_cast<GstPluginAPIFlags>(0)); // so that it is documented
  return type;
}

template <class S> struct Property;

/// Where S keeps a property.
template <class S> struct Field {
  GParamSpec* (*spec)(const Property<S>&) = nullptr;
  void (*set)(S&, const GValue*) = nullptr;
  void (*get)(const S&, GValue*) = nullptr;
  GstStructure* (*make)(gpointer object) = nullptr; ///< instead of both, where the value is made to be read
  double low = 0, high = 0;                         ///< of a number
  const char* type = nullptr;                       ///< of an enumeration
  std::span<const Choice> choices = {};             ///< of it, from 0 on
};

template <class S> struct Property {
  const char *name, *nick, *blurb;
  GParamFlags flags;
  Field<S> field;
};

/// The functions of GObject for values that are no text.
template <auto make_spec, auto get_value, auto set_value> struct Functions {
  static constexpr auto spec = make_spec;
  static constexpr auto get = get_value;
  static constexpr auto set = set_value;
};
/// Of enumerations.
template <class Value>
struct ValueFunctions : Functions<g_param_spec_enum, g_value_get_enum, g_value_set_enum> {};
template <>
struct ValueFunctions<bool> : Functions<g_param_spec_boolean, g_value_get_boolean, g_value_set_boolean> {};
template <> struct ValueFunctions<int> : Functions<g_param_spec_int, g_value_get_int, g_value_set_int> {};
template <>
struct ValueFunctions<std::uint32_t> : Functions<g_param_spec_uint, g_value_get_uint, g_value_set_uint> {};
template <>
struct ValueFunctions<double> : Functions<g_param_spec_double, g_value_get_double, g_value_set_double> {};

/// The end of a path of member pointers, such as &Settings::window, &Window::width.
template <auto... path> auto& member(auto& start) {
  return (start.*....*path);
}
template <class S, class T, class... Rest> S owner_of(T S::*, Rest...);
template <auto... path> using OwnerOf = decltype(owner_of(path...));

/// What a member holds.
template <class T> struct Held { using Type = T; };
template <class T> struct Held<std::atomic<T>> { using Type = T; };

/// The field at the end of a path. The default of the property is the value in a default-constructed S; text
/// has none, and empty text is NULL.
template <auto... path> constexpr Field<OwnerOf<path...>> field(double low = 0, double high = 0) {
  using S = OwnerOf<path...>;
  using Value = typename Held<std::remove_cvref_t<decltype(member<path...>(std::declval<S&>()))>>::Type;
  Field<S> made;
  made.low = low;
  made.high = high;
  if constexpr (std::is_enum_v<Value> || std::is_arithmetic_v<Value>) {
    using Functions = ValueFunctions<Value>;
    made.spec = [](const Property<S>& p) {
      const S standard;
      const Value value = member<path...>(standard);
      if constexpr (std::is_enum_v<Value>)
        return Functions::spec(p.name, p.nick, p.blurb, choice_type(p.field.type, p.field.choices),
                               static_cast<int>(value), p.flags);
      else if constexpr (std::is_same_v<Value, bool>)
        return Functions::spec(p.name, p.nick, p.blurb, value, p.flags);
      else
        return Functions::spec(p.name, p.nick, p.blurb, static_cast<Value>(p.field.low),
                               static_cast<Value>(p.field.high), value, p.flags);
    };
    made.set = [](S& s, const GValue* value) {
      member<path...>(s) = static_cast<Value>(Functions::get(value));
    };
    made.get = [](const S& s, GValue* value) {
      const Value kept = member<path...>(s);
      Functions::set(value, static_cast<decltype(Functions::get(value))>(kept));
    };
  } else {
    made.spec = [](const Property<S>& p) {
      return g_param_spec_string(p.name, p.nick, p.blurb, nullptr, p.flags);
    };
    made.set = [](S& s, const GValue* value) {
      const gchar* text = g_value_get_string(value);
      member<path...>(s) = text ? text : "";
    };
    made.get = [](const S& s, GValue* value) {
      const char* text = member<path...>(s).c_str();
      g_value_set_string(value, *text ? text : nullptr);
    };
  }
  return made;
}
/// A field that is an enumeration: its type, and its values in the order of the enumeration.
template <auto... path>
constexpr Field<OwnerOf<path...>> field(const char* type, std::span<const Choice> choices) {
  auto made = field<path...>();
  made.type = type;
  made.choices = choices;
  return made;
}

/// The row `stats` of a table: a structure that is made when it is read.
template <class S>
constexpr Property<S> stats_row(const char* blurb, GstStructure* (*make)(gpointer object)) {
  Field<S> made;
  made.spec = [](const Property<S>& p) {
    return g_param_spec_boxed(p.name, p.nick, p.blurb, GST_TYPE_STRUCTURE, p.flags);
  };
  made.make = make;
  return {"stats", "Statistics", blurb, property_readable, made};
}

/// The row `source` of a table: an InternedName.
template <auto... path> constexpr Property<OwnerOf<path...>> source_row() {
  return {"source", "Source",
          "Name (property instance) of the terrainseg element whose metadata is used; none = the metadata "
          "attached last",
          property_playing, field<path...>()};
}

/// Installs the rows with the ids first_id, first_id + 1, ...
inline void install_table(GObjectClass* object_class, guint first_id, const auto& table) {
  for (const auto& row : table)
    g_object_class_install_property(object_class, first_id++, row.field.spec(row));
}

} // namespace terrainseg
