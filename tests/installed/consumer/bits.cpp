// Prints what the steps of the headers compute, digit by digit, so that two builds of this file can be compared.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>

#include "mgdd/common/platform.hpp"
#include "mgdd/optimize/laws/extremum_seeking.hpp"
#include "mgdd/optimize/laws/spsa.hpp"
#include "mgdd/optimize/least_squares/recursive_least_squares.hpp"
#include "mgdd/throttle/models/pw_r.hpp"
#include "mgdd/throttle/plant.hpp"

namespace {

/// Every bit of every number that passes by (FNV-1a).
class Digest {
 public:
  void add(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    for (int shift = 0; shift < 64; shift += 8)
      hash_ = (hash_ ^ ((bits >> shift) & 0xffU)) * 0x100000001b3ULL;
    last_ = value;
  }
  void print(const char* name) const {
    std::printf("%s %016llx %a\n", name, static_cast<unsigned long long>(hash_), last_);
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
  double last_ = 0.0;
};

double duty_at(int k) {
  return 0.1 + 0.25 * std::sin(0.0031 * k) + 0.07 * std::sin(0.0173 * k);
}

void pw_r() {
  mgdd::throttle::PwR parameters;
  parameters.above.square_per_deg = 3e-4;
  parameters.below.spring_duty_per_deg = 7e-4;
  const mgdd::throttle::PwRModel model(parameters);
  auto state = model.at_rest(8.0, 0.0);
  Digest digest;
  for (int k = 0; k < 20000; ++k) {
    model.step(state, duty_at(k));
    digest.add(model.output(state));
  }
  digest.print("pw_r");
}

void plant(const char* name, mgdd::throttle::Friction friction, mgdd::throttle::Backlash backlash) {
  mgdd::throttle::Throttle parameters;
  parameters.friction = friction;
  parameters.backlash = backlash;
  parameters.stiction_nm = 0.31;
  parameters.pressure_drop_kpa = 40.0;
  const mgdd::throttle::ThrottlePlant plant(parameters);
  auto state = mgdd::throttle::at_rest(8.0);
  mgdd::throttle::ThrottleInput input;
  Digest digest;
  for (int k = 0; k < 50000; ++k) {
    input.duty = duty_at(k / 10);
    plant.step(state, input);
    digest.add(state.plate_angle_rad);
    digest.add(state.current_a);
  }
  digest.print(name);
}

template <class Seeker>
void seek(const char* name, Seeker seeker) {
  Digest digest;
  for (int k = 0; k < 2000; ++k) {
    const mgdd::optimize::Inputs x = seeker.ask();
    double j = 0.0;
    for (Eigen::Index i = 0; i < x.size(); ++i)
      j -= (x[i] - 1.7) * (x[i] - 1.7) * 0.05 * static_cast<double>(i + 1);
    const double components[] = {j};
    seeker.tell({components, {}, false});
    for (Eigen::Index i = 0; i < x.size(); ++i)
      digest.add(seeker.estimate()[i]);
  }
  digest.print(name);
}

mgdd::optimize::SearchSpace space() {
  using mgdd::optimize::Inputs;
  return {Inputs::Zero(5), Inputs::Constant(5, -20.0), Inputs::Constant(5, 20.0)};
}

void recursive() {
  mgdd::optimize::RecursiveLeastSquares<5> estimator({});
  Digest digest;
  for (int k = 0; k < 5000; ++k) {
    mgdd::optimize::RecursiveLeastSquares<5>::Column phi;
    for (int i = 0; i < 5; ++i)
      phi[i] = std::sin(0.01 * (i + 1) * k + 0.3 * i);
    estimator.update(phi, 0.7 * phi[0] - 1.3 * phi[2] + 0.1 * phi[4] + 0.01 * std::sin(1.0 * k));
    for (int i = 0; i < 5; ++i)
      digest.add(estimator.estimate()[i]);
  }
  digest.print("recursive");
}

}  // namespace

int main() {
  using mgdd::throttle::Backlash;
  using mgdd::throttle::Friction;
  std::printf("library %s\n", mgdd::compiled_simd_level().c_str());
  pw_r();
  plant("plant_coulomb", Friction::coulomb, Backlash::none);
  plant("plant_stribeck", Friction::stribeck, Backlash::compliance);
  plant("plant_lugre", Friction::lugre, Backlash::hysteresis);
  mgdd::optimize::SpsaSettings spsa;
  spsa.space = space();
  spsa.gain = mgdd::optimize::scalar_input(0.5);
  seek("spsa", mgdd::optimize::Spsa(spsa));
  mgdd::optimize::ExtremumSeekingSettings seeking;
  seeking.space = mgdd::optimize::SearchSpace{mgdd::optimize::scalar_input(-3.0), mgdd::optimize::scalar_input(-20.0),
                                              mgdd::optimize::scalar_input(20.0)};
  seek("extremum_seeking", mgdd::optimize::ExtremumSeeking(seeking));
  recursive();
  return 0;
}
