// SPDX-License-Identifier: LGPL-2.1-or-later
// A table of properties that are fields of a plain struct: creates their GParamSpecs, sets and gets them.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <variant>

namespace terrainseg {

/// Can be set in any state; `controllable` can also be bound to a controller; `before_start` can be set up to
/// READY.
inline constexpr auto property_playing =
    static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
inline constexpr auto property_controllable =
    static_cast<GParamFlags>(property_playing | GST_PARAM_CONTROLLABLE);
inline constexpr auto property_before_start =
    static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);

/// A numeric field with its range.
template <class S, class Number> struct NumberField {
  Number& (*of)(S&);
  Number low, high;
};
template <class S, class Value> struct PlainField { Value& (*of)(S&); };
template <class S> struct ChoiceField {
  GType (*type)();
  int (*get)(const S&);
  void (*set)(S&, int);
};
template <class S>
using Field = std::variant<NumberField<S, int>, NumberField<S, std::uint32_t>, NumberField<S, double>,
                           PlainField<S, bool>, PlainField<S, std::string>, ChoiceField<S>>;

template <class S> struct Property {
  const char *name, *nick, *blurb;
  GParamFlags flags;
  Field<S> field;
};

template <class... Lambdas> struct Overloaded : Lambdas... { using Lambdas::operator()...; };
template <class... Lambdas> Overloaded(Lambdas...) -> Overloaded<Lambdas...>;

/// Creates a GParamSpec. The default is the value in a default-constructed S.
template <class S> GParamSpec* spec_of(const Property<S>& p) {
  S d;
  return std::visit(Overloaded{
                        [&](const NumberField<S, int>& f) {
                          return g_param_spec_int(p.name, p.nick, p.blurb, f.low, f.high, f.of(d), p.flags);
                        },
                        [&](const NumberField<S, std::uint32_t>& f) {
                          return g_param_spec_uint(p.name, p.nick, p.blurb, f.low, f.high, f.of(d), p.flags);
                        },
                        [&](const NumberField<S, double>& f) {
                          return g_param_spec_double(p.name, p.nick, p.blurb, f.low, f.high, f.of(d),
                                                     p.flags);
                        },
                        [&](const PlainField<S, bool>& f) {
                          return g_param_spec_boolean(p.name, p.nick, p.blurb, f.of(d), p.flags);
                        },
                        [&](const PlainField<S, std::string>&) {
                          return g_param_spec_string(p.name, p.nick, p.blurb, nullptr, p.flags);
                        },
                        [&](const ChoiceField<S>& f) {
                          return g_param_spec_enum(p.name, p.nick, p.blurb, f.type(), f.get(d), p.flags);
                        },
                    },
                    p.field);
}

/// Installs the table with the ids first_id, first_id + 1, ...
template <class S>
void install_properties(GObjectClass* object_class, guint first_id, std::span<const Property<S>> table) {
  for (const Property<S>& property : table)
    g_object_class_install_property(object_class, first_id++, spec_of(property));
}

/// The caller holds the object lock.
template <class S> void set_field(const Property<S>& property, S& settings, const GValue* value) {
  std::visit(Overloaded{
                 [&](const NumberField<S, int>& f) { f.of(settings) = g_value_get_int(value); },
                 [&](const NumberField<S, std::uint32_t>& f) { f.of(settings) = g_value_get_uint(value); },
                 [&](const NumberField<S, double>& f) { f.of(settings) = g_value_get_double(value); },
                 [&](const PlainField<S, bool>& f) { f.of(settings) = g_value_get_boolean(value); },
                 [&](const PlainField<S, std::string>& f) {
                   const gchar* text = g_value_get_string(value);
                   f.of(settings) = text ? text : "";
                 },
                 [&](const ChoiceField<S>& f) { f.set(settings, g_value_get_enum(value)); },
             },
             property.field);
}

/// Empty text is returned as NULL. The caller holds the object lock.
template <class S> void get_field(const Property<S>& property, const S& from, GValue* value) {
  auto& settings = const_cast<S&>(from); // one accessor for reading and writing; this function only reads
  std::visit(Overloaded{
                 [&](const NumberField<S, int>& f) { g_value_set_int(value, f.of(settings)); },
                 [&](const NumberField<S, std::uint32_t>& f) { g_value_set_uint(value, f.of(settings)); },
                 [&](const NumberField<S, double>& f) { g_value_set_double(value, f.of(settings)); },
                 [&](const PlainField<S, bool>& f) { g_value_set_boolean(value, f.of(settings)); },
                 [&](const PlainField<S, std::string>& f) {
                   const std::string& text = f.of(settings);
                   g_value_set_string(value, text.empty() ? nullptr : text.c_str());
                 },
                 [&](const ChoiceField<S>& f) { g_value_set_enum(value, f.get(from)); },
             },
             property.field);
}

/// The field FIELD (such as settings.window.width) of S.
// Names of members and types, which must not be in parentheses. NOLINTBEGIN(bugprone-macro-parentheses)
#define TERRAINSEG_FIELD(S, FIELD)                                                                           \
  [](S& settings) -> std::remove_reference_t<decltype((settings.FIELD))>& { return settings.FIELD; }
/// A ChoiceField for an enumeration.
#define TERRAINSEG_CHOICE(S, FIELD, TYPE)                                                                    \
  ChoiceField<S> {                                                                                           \
    TYPE, [](const S& settings) { return static_cast<int>(settings.FIELD); }, [](S& settings, int value) {   \
      settings.FIELD = static_cast<std::remove_reference_t<decltype((settings.FIELD))>>(value);              \
    }                                                                                                        \
  }
// NOLINTEND(bugprone-macro-parentheses)

} // namespace terrainseg
