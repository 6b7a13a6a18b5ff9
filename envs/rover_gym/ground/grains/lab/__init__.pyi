from .fits import (
    PressureLaw as PressureLaw,
    ShearLaw as ShearLaw,
    Strength as Strength,
    fit_pressure as fit_pressure,
    fit_pull as fit_pull,
    fit_shear as fit_shear,
    fit_strength as fit_strength,
)
from .plate_and_shear import (
    PlatePoint as PlatePoint,
    ShearPoint as ShearPoint,
    plate_test as plate_test,
    shear_test as shear_test,
)
from .rig import write_table as write_table
from .wheel import WheelPoint as WheelPoint, wheel_test as wheel_test
