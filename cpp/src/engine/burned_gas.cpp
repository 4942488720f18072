#include "mgdd/engine/burned_gas.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/common/units.hpp"
#include "mgdd/math/monotone_inverse.hpp"

namespace mgdd::engine {
namespace {

constexpr double atm_pa = 101325.0, middle_k = 1000.0, standard_k = 298.15;
constexpr double ln_least = -32.0;  // of the square root of the pressure of oxygen

// cp/R = a0 + a1 T + ... + a4 T^4, a5 the constant of enthalpy, a6 that of entropy: below 1000 K, and above.
struct Polynomials {
  double low[7], high[7];
};
constexpr Polynomials gri[species_count] = {
    {{3.298677, 1.4082404e-3, -3.963222e-6, 5.641515e-9, -2.444854e-12, -1020.8999, 3.950372},
     {2.92664, 1.4879768e-3, -5.68476e-7, 1.0097038e-10, -6.753351e-15, -922.7977, 5.980528}},
    {{3.78245636, -2.99673416e-3, 9.84730201e-6, -9.68129509e-9, 3.24372837e-12, -1063.94356, 3.65767573},
     {3.28253784, 1.48308754e-3, -7.57966669e-7, 2.09470555e-10, -2.16717794e-14, -1088.45772, 5.45323129}},
    {{2.35677352, 8.98459677e-3, -7.12356269e-6, 2.45919022e-9, -1.43699548e-13, -48371.9697, 9.90105222},
     {3.85746029, 4.41437026e-3, -2.21481404e-6, 5.23490188e-10, -4.72084164e-14, -48759.166, 2.27163806}},
    {{4.19864056, -2.0364341e-3, 6.52040211e-6, -5.48797062e-9, 1.77197817e-12, -30293.7267, -0.849032208},
     {3.03399249, 2.17691804e-3, -1.64072518e-7, -9.7041987e-11, 1.68200992e-14, -30004.2971, 4.9667701}},
    {{3.57953347, -6.1035368e-4, 1.01681433e-6, 9.07005884e-10, -9.04424499e-13, -14344.086, 3.50840928},
     {2.71518561, 2.06252743e-3, -9.98825771e-7, 2.30053008e-10, -2.03647716e-14, -14151.8724, 7.81868772}},
    {{2.34433112, 7.98052075e-3, -1.9478151e-5, 2.01572094e-8, -7.37611761e-12, -917.935173, 0.683010238},
     {3.3372792, -4.94024731e-5, 4.99456778e-7, -1.79566394e-10, 2.00255376e-14, -950.158922, -3.20502331}},
    {{3.99201543, -2.40131752e-3, 4.61793841e-6, -3.88113333e-9, 1.3641147e-12, 3615.08056, -0.103925458},
     {3.09288767, 5.48429716e-4, 1.26505228e-7, -8.79461556e-11, 1.17412376e-14, 3858.657, 4.4766961}},
    {{3.1682671, -3.27931884e-3, 6.64306396e-6, -6.12806624e-9, 2.11265971e-12, 29122.2592, 2.05193346},
     {2.56942078, -8.59741137e-5, 4.19484589e-8, -1.00177799e-11, 1.22833691e-15, 29217.5791, 4.78433864}},
    {{2.5, 7.05332819e-13, -1.99591964e-15, 2.30081632e-18, -9.27732332e-22, 25473.6599, -0.446682853},
     {2.50000001, -2.30842973e-11, 1.61561948e-14, -4.73515235e-18, 4.98197357e-22, 25473.6599, -0.446682914}},
    {{4.2184763, -4.638976e-3, 1.1041022e-5, -9.3361354e-9, 2.803577e-12, 9844.623, 2.2808464},
     {3.2606056, 1.1911043e-3, -4.2917048e-7, 6.9457669e-11, -4.0336099e-15, 9920.9746, 6.3693027}}};

const double (&polynomial(Species s, double t) noexcept)[7] {
  const Polynomials& p = gri[static_cast<std::size_t>(s)];
  return t < middle_k ? p.low : p.high;
}

double gibbs_over_rt(Species s, double t) noexcept {
  return (enthalpy_j_per_mol(s, t) / t - entropy_j_per_mol_k(s, t)) / units::gas_constant_j_per_molk;
}

// Equilibrium constants of formation from N2, O2, H2 and CO, pressures in atm.
struct Constants {
  double o, h, oh, no, h2o, co2;

  explicit Constants(double t) noexcept {
    const auto g = [t](Species s) { return gibbs_over_rt(s, t); };
    const double o2 = 0.5 * g(Species::o2), h2 = 0.5 * g(Species::h2), n2 = 0.5 * g(Species::n2);
    o = std::exp(o2 - g(Species::o));
    h = std::exp(h2 - g(Species::h));
    oh = std::exp(o2 + h2 - g(Species::oh));
    no = std::exp(o2 + n2 - g(Species::no));
    h2o = std::exp(2.0 * h2 + o2 - g(Species::h2o));
    co2 = std::exp(g(Species::co) + o2 - g(Species::co2));
  }
};

struct Elements {
  double c, h, o, n;
};

Elements elements_of(const Reactants& r) noexcept {
  const ChargeFractions x = charge_fractions(r);
  const double n = r.charge_mol();
  return {1.0 + n * x.co2, r.hydrogen_to_carbon + 2.0 * n * x.h2o, n * (2.0 * x.o2 + 2.0 * x.co2 + x.h2o),
          2.0 * n * x.n2};
}

// Positive root of a r^2 + b r = c.
double root(double a, double b, double c) noexcept {
  return 2.0 * c / (b + std::sqrt(b * b + 4.0 * a * c));
}

// Partial pressures where the square root of that of oxygen is u, and moles per pressure are q.
struct Pressures {
  double n2, o2, co2, h2o, co, h2, oh, o, h, no;

  Pressures(const Constants& k, const Elements& e, double u, double q) noexcept {
    const double sqrt_h2 = root(2.0 + 2.0 * k.h2o * u, k.oh * u + k.h, e.h / q);
    const double sqrt_n2 = root(2.0, k.no * u, e.n / q);
    n2 = sqrt_n2 * sqrt_n2, h2 = sqrt_h2 * sqrt_h2, o2 = u * u;
    co = e.c / (q * (1.0 + k.co2 * u));
    co2 = k.co2 * u * co, h2o = k.h2o * u * h2;
    oh = k.oh * u * sqrt_h2, o = k.o * u, h = k.h * sqrt_h2, no = k.no * u * sqrt_n2;
  }
  [[nodiscard]] double oxygen() const noexcept { return 2.0 * (o2 + co2) + h2o + co + oh + o + no; }
  [[nodiscard]] double sum() const noexcept { return n2 + o2 + co2 + h2o + co + h2 + oh + o + h + no; }
};

}  // namespace

double enthalpy_j_per_mol(Species s, double t) noexcept {
  const auto& a = polynomial(s, t);
  const double over_rt = a[0] + t * (a[1] / 2.0 + t * (a[2] / 3.0 + t * (a[3] / 4.0 + t * a[4] / 5.0))) + a[5] / t;
  return units::gas_constant_j_per_molk * t * over_rt;
}

double entropy_j_per_mol_k(Species s, double t) noexcept {
  const auto& a = polynomial(s, t);
  return units::gas_constant_j_per_molk *
         (a[0] * std::log(t) + t * (a[1] + t * (a[2] / 2.0 + t * (a[3] / 3.0 + t * a[4] / 4.0))) + a[6]);
}

ChargeFractions charge_fractions(const Reactants& r) noexcept {
  constexpr double air = 0.209;
  const double needed = 1.0 + 0.25 * r.hydrogen_to_carbon;
  // Of a mole of air that has burned without excess.
  const double co2 = air / needed, h2o = 0.5 * r.hydrogen_to_carbon * co2, moles = 1.0 - air + co2 + h2o;
  const double burned = 1.0 - std::min(r.charge_o2_fraction / air, 1.0);  // share of the charge by moles
  return {air * (1.0 - burned), (1.0 - air) * (1.0 - burned) + burned * (1.0 - air) / moles, burned * co2 / moles,
          burned * h2o / moles};
}

BurnedGas burned_gas(const Reactants& r, double temperature_k, double pressure_pa) noexcept {
  const Constants k(temperature_k);
  const Elements e = elements_of(r);
  const double p = pressure_pa / atm_pa;
  double q = (e.c + 0.5 * e.h + 0.5 * e.n + std::max(0.5 * e.o - e.c - 0.25 * e.h, 0.0)) / p, u = 0.0;
  for (int outer = 0; outer < 40; ++outer) {
    // The oxygen that the gas holds rises with u; then the moles by the pressure.
    const auto oxygen = [&](double ln_u) { return std::log(q * Pressures(k, e, std::exp(ln_u), q).oxygen()); };
    u = std::exp(monotone_inverse(oxygen, std::log(e.o), ln_least, 0.5 * std::log(p)));
    const double sum = Pressures(k, e, u, q).sum();
    q *= sum / p;
    if (std::abs(sum / p - 1.0) < 1e-11) break;
  }
  const Pressures x(k, e, u, q);
  BurnedGas out;
  out.fraction = {x.n2, x.o2, x.co2, x.h2o, x.co, x.h2, x.oh, x.o, x.h, x.no};
  out.moles = q * p;
  for (std::size_t s = 0; s < species_count; ++s) {
    out.fraction[s] /= p;
    out.enthalpy_j += out.moles * out.fraction[s] * enthalpy_j_per_mol(static_cast<Species>(s), temperature_k);
  }
  return out;
}

double flame_temperature_k(const Reactants& r, double charge_k, double pressure_pa) noexcept {
  const auto at = [](Species s, double t) { return enthalpy_j_per_mol(s, t); };
  const ChargeFractions x = charge_fractions(r);
  const double fuel = r.heating_value_j_per_kg * r.fuel_kg_per_mol() + at(Species::co2, standard_k) +
                      0.5 * r.hydrogen_to_carbon * at(Species::h2o, standard_k);
  const double wanted =
      fuel + r.charge_mol() * (x.o2 * at(Species::o2, charge_k) + x.n2 * at(Species::n2, charge_k) +
                               x.co2 * at(Species::co2, charge_k) + x.h2o * at(Species::h2o, charge_k));
  return monotone_inverse([&](double t) { return burned_gas(r, t, pressure_pa).enthalpy_j; }, wanted, 300.0, 5000.0);
}

}  // namespace mgdd::engine
