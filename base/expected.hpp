#pragma once

#include <tl/expected.hpp>
#include <utility>

/// The world fails by value: a function whose failure is an ordinary day in a plant returns Expected<T, E>, with E a
/// small struct of its module (what, where, numbers). Text is made of it at the edge, by to_string.
namespace binpick {
template <class T, class E>
using Expected = tl::expected<T, E>;

template <class E>
auto unexpected(E&& error) {
  return tl::make_unexpected(std::forward<E>(error));
}
}  // namespace binpick
