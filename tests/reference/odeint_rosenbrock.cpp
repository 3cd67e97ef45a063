#include "odeint_rosenbrock.hpp"

// The linear algebra of odeint throws an exception if a matrix is nearly singular. The checks are
// off because the error estimate covers this case.
#define BOOST_UBLAS_NDEBUG 1
#include <algorithm>
#include <boost/numeric/odeint/stepper/rosenbrock4.hpp>
#include <utility>

namespace hamelin::reference {

namespace ublas = boost::numeric::ublas;

struct OdeintRosenbrock::Implementation {
  Implementation(std::size_t size, Derivative f, Jacobian j)
      : derivative(std::move(f)), jacobian(std::move(j)), y(size), next(size), error(size) {}

  Derivative derivative;
  Jacobian jacobian;
  boost::numeric::odeint::rosenbrock4<double> method;
  ublas::vector<double> y, next, error;
};

OdeintRosenbrock::OdeintRosenbrock(std::size_t size, Derivative derivative, Jacobian jacobian)
    : implementation_(
          std::make_unique<Implementation>(size, std::move(derivative), std::move(jacobian))) {}

OdeintRosenbrock::~OdeintRosenbrock() = default;

void OdeintRosenbrock::step(const double* y, double h, double* next, double* error) {
  auto& s = *implementation_;
  const auto size = s.y.size();
  std::copy_n(y, size, s.y.begin());
  auto derivative = [&s](const ublas::vector<double>& at, ublas::vector<double>& dy, double) {
    s.derivative(&at[0], &dy[0]);
  };
  auto jacobian = [&s](const ublas::vector<double>& at, ublas::matrix<double>& J, double,
                       ublas::vector<double>& by_time) {
    std::fill(by_time.begin(), by_time.end(), 0.0);
    s.jacobian(&at[0], &J.data()[0]);
  };
  s.method.do_step(std::make_pair(derivative, jacobian), s.y, 0.0, s.next, h, s.error);
  std::copy_n(s.next.begin(), size, next);
  std::copy_n(s.error.begin(), size, error);
}

}  // namespace hamelin::reference
