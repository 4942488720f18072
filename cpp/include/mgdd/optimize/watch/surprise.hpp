// Whether readings are no more what a model expects: the running mean of their squared normalised innovations, 1 where
// it is right. noexcept and free of allocation.
#pragma once

#include <algorithm>
#include <string>

namespace mgdd::optimize {

class Surprise {
 public:
  /// True once the last readings are surprising: no single one is, but two in a row may be.
  bool add(double odd) noexcept {
    mean_ += rate * (std::min(odd, most_odd) - mean_);
    return mean_ >= most;
  }
  void reset() noexcept { mean_ = 1.0; }

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name, self.mean_);
  }

 private:
  static constexpr double rate = 0.1, most = 3.0, most_odd = 12.0;
  double mean_ = 1.0;
};

}  // namespace mgdd::optimize
