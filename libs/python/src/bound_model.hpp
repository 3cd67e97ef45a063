#pragma once
#include <memory>
#include <utility>

#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/model.hpp"
#include "whole.hpp"

namespace hamelin::python {

/// hamelin.Model: a model with scratch memory for single calls, which hold Python's lock. Calls
/// that release the lock use scratch memory of their own.
struct BoundModel : Whole {
  explicit BoundModel(model::Model given) : model(std::move(given)), ws(model) {}
  BoundModel(const BoundModel&) = delete;
  BoundModel& operator=(const BoundModel&) = delete;

  /// Scratch memory for derivatives, made when it is first used.
  dynamics::DerivativesWorkspace& derivatives() {
    if (!derivatives_) derivatives_ = std::make_unique<dynamics::DerivativesWorkspace>(model);
    return *derivatives_;
  }

  const model::Model model;
  dynamics::Workspace ws;

 private:
  std::unique_ptr<dynamics::DerivativesWorkspace> derivatives_;
};

using SharedModel = std::shared_ptr<BoundModel>;

}  // namespace hamelin::python
