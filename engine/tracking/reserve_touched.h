// Room in a list whose pages are there: reserve() alone leaves the first use to pay for them.
#pragma once

#include <cstddef>
#include <cstring>

namespace haustra {

// For elements that any bytes make: the list is empty when this returns.
template <typename Vector>
void ReserveTouched(Vector* list, std::size_t capacity) {
  list->resize(capacity);
  std::memset(static_cast<void*>(list->data()), 0, capacity * sizeof(typename Vector::value_type));
  list->clear();
}

}  // namespace haustra
