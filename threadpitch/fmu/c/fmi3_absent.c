/* The functions of FMI 3.0 that these FMUs do not provide: all must be there (FMI 3.0.2, section 2.5.1), return
 * fmi3Error and say why. */
#include "fmi3_component.h"

/* what is not provided has no use for its parameters */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#elif defined(_MSC_VER)
#pragma warning(disable : 4100)
#endif

/* Types that no model has ----------------------------------------------------------------------------------------- */

static fmi3Status no_such_type(fmi3Instance instance, const char *function, size_t count)
{
    if (instance == NULL) {
        return fmi3Error;
    }
    if (count == 0) {
        return fmi3OK;
    }
    return (fmi3Status)instance_fail(instance, "%s is not for this FMU: its variables are Float64, Int32, Boolean and "
                                               "Clock; see its model description", function);
}

#define ABSENT_TYPE(Type)                                                                                             \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],                       \
                             size_t nValueReferences, fmi3##Type values[], size_t nValues)                            \
    {                                                                                                                 \
        return no_such_type(instance, "fmi3Get" #Type, nValueReferences);                                             \
    }                                                                                                                 \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],                       \
                             size_t nValueReferences, const fmi3##Type values[], size_t nValues)                      \
    {                                                                                                                 \
        return no_such_type(instance, "fmi3Set" #Type, nValueReferences);                                             \
    }

ABSENT_TYPE(Float32)
ABSENT_TYPE(Int8)
ABSENT_TYPE(UInt8)
ABSENT_TYPE(Int16)
ABSENT_TYPE(UInt16)
ABSENT_TYPE(UInt32)
ABSENT_TYPE(Int64)
ABSENT_TYPE(UInt64)
ABSENT_TYPE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    return no_such_type(instance, "fmi3GetBinary", nValueReferences);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    return no_such_type(instance, "fmi3SetBinary", nValueReferences);
}

/* Capabilities that no FMU has ------------------------------------------------------------------------------------ */

static fmi3Status absent(fmi3Instance instance, const char *function)
{
    if (instance == NULL) {
        return fmi3Error;
    }
    return (fmi3Status)instance_fail(instance, "%s is not provided; see the capabilities in the model description",
                                     function);
}

#define ABSENT_ALONE(function)                                                                                        \
    fmi3Status function(fmi3Instance instance)                                                                        \
    {                                                                                                                 \
        return absent(instance, #function);                                                                           \
    }
#define ABSENT(function, ...)                                                                                         \
    fmi3Status function(fmi3Instance instance, __VA_ARGS__)                                                           \
    {                                                                                                                 \
        return absent(instance, #function);                                                                           \
    }

ABSENT(fmi3GetNumberOfVariableDependencies, fmi3ValueReference valueReference, size_t *nDependencies)
ABSENT(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
       fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
       size_t nDependencies)
ABSENT(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t nUnknowns,
       const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
       fmi3Float64 sensitivity[], size_t nSensitivity)
ABSENT(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t nUnknowns,
       const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
       fmi3Float64 sensitivity[], size_t nSensitivity)
ABSENT_ALONE(fmi3EnterConfigurationMode)
ABSENT_ALONE(fmi3ExitConfigurationMode)

/* The only clocks are triggered output clocks: they have no intervals, and nobody sets them. */
ABSENT(fmi3SetClock, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Clock values[])
ABSENT(fmi3GetIntervalDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
ABSENT(fmi3GetIntervalFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
ABSENT(fmi3GetShiftDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 shifts[])
ABSENT(fmi3GetShiftFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       fmi3UInt64 counters[], fmi3UInt64 resolutions[])
ABSENT(fmi3SetIntervalDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       const fmi3Float64 intervals[])
ABSENT(fmi3SetIntervalFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(fmi3SetShiftDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       const fmi3Float64 shifts[])
ABSENT(fmi3SetShiftFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
       const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

/* Model exchange and scheduled execution. */
ABSENT_ALONE(fmi3EnterContinuousTimeMode)
ABSENT(fmi3CompletedIntegratorStep, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode,
       fmi3Boolean *terminateSimulation)
ABSENT(fmi3SetTime, fmi3Float64 time)
ABSENT(fmi3SetContinuousStates, const fmi3Float64 continuousStates[], size_t nContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t nContinuousStates)
ABSENT(fmi3GetEventIndicators, fmi3Float64 eventIndicators[], size_t nEventIndicators)
ABSENT(fmi3GetContinuousStates, fmi3Float64 continuousStates[], size_t nContinuousStates)
ABSENT(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t nContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators, size_t *nEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates, size_t *nContinuousStates)
ABSENT(fmi3ActivateModelPartition, fmi3ValueReference clockReference, fmi3Float64 activationTime)
