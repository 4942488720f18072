// Numbers and bounds of the pseudo-Wiener models: nothing is exchanged and nothing is lost.
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "mgdd/common/error.hpp"
#include "support/asymmetric_pseudo_wiener.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_pw_p;
using test::asymmetric_pw_r;
using test::asymmetric_pw_w;

TEST(PseudoWienerNumbers, SettingsOutsideTheirBoundsAreNamed) {
  const auto refused = [](auto good, auto change, const std::string& part) {
    EXPECT_NO_THROW(good.validate());
    change(good);
    try {
      good.validate();
      ADD_FAILURE() << part;
    } catch (const ParameterError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  const PwR r = asymmetric_pw_r();
  refused(r, [](PwR& p) { p.limp_home_deg = 1.0; }, "limp_home_deg = 1 deg");
  refused(r, [](PwR& p) { p.limp_home_deg = 85.0; }, "limp_home_deg = 85 deg");
  refused(r, [](PwR& p) { p.frame.open_deg = 10.0, p.frame.closed_deg = 10.0; }, "must be above closed_deg");
  refused(r, [](PwR& p) { p.frame.sample_s = 0.2; }, "sample_s = 0.2");
  refused(r, [](PwR& p) { p.frame.substeps = 0; }, "substeps = 0");
  refused(r, [](PwR& p) { p.frame.delay_samples = -1; }, "delay_samples = -1");
  refused(r, [](PwR& p) { p.ramp_deg = 0.0; }, "ramp_deg = 0");
  refused(r, [](PwR& p) { p.tanh_deg_per_s = 0.0; }, "tanh_deg_per_s = 0");
  refused(r, [](PwR& p) { p.dead_band_deg = -1.0; }, "dead_band_deg = -1");
  // A map may fall on one side only, where only that side reaches far enough.
  refused(r, [](PwR& p) { p.above.square_per_deg = -5e-3, p.above.cube_per_deg2 = -4e-5; }, "above_square_per_deg");
  refused(
      r,
      [](PwR& p) {
        p.frame.closed_deg = -10.0, p.limp_home_deg = 80.0, p.below.square_per_deg = 5e-3, p.below.cube_per_deg2 = 0.0;
      },
      "below_square_per_deg");
  refused(asymmetric_pw_w(), [](PwW& p) { p.knot_upper_duty = -0.27; }, "must be above knot_lower_duty");
  refused(asymmetric_pw_w(), [](PwW& p) { p.knot_lower_duty = -1.1; }, "knot_lower_duty = -1.1");
  refused(asymmetric_pw_p(), [](PwP& p) { p.plays = 0; }, "plays = 0");
  for (const auto& [member, name] : {std::pair{&ObserverGains::angle_gain, "angle_gain"},
                                     {&ObserverGains::speed_gain_per_s, "speed_gain_per_s"},
                                     {&ObserverGains::bias_gain_duty_per_deg, "bias_gain_duty_per_deg"},
                                     {&ObserverGains::bias_limit_duty, "bias_limit_duty"},
                                     {&ObserverGains::offset_gain, "offset_gain"}}) {
    refused(ObserverGains{}, [member = member](ObserverGains& a) { a.*member = -0.1; }, std::string(name) + " = -0.1");
    refused(ObserverGains{}, [member = member](ObserverGains& a) { a.*member = 2e4; }, std::string(name) + " = 20000");
  }
}

}  // namespace
}  // namespace mgdd::throttle
