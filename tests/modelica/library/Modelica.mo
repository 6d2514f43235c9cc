package Modelica
  "The classes of the Modelica Standard Library that a package of fmu modelica uses, as its specification has them, for the test without that library"

  package Icons
    partial package Package
    end Package;
    partial package ExamplesPackage
    end ExamplesPackage;
    partial package RecordsPackage
    end RecordsPackage;
    partial package TypesPackage
    end TypesPackage;
    partial model Example
    end Example;
    partial record Record
    end Record;
  end Icons;

  package Blocks
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
      connector BooleanInput = input Boolean;
      connector BooleanOutput = output Boolean;
    end Interfaces;
    package Sources
      block Step
        parameter Real height = 1;
        parameter Real offset = 0;
        parameter Real startTime = 0;
        Interfaces.RealOutput y;
      equation
        y = offset + (if time < startTime then 0 else height);
      end Step;
    end Sources;
  end Blocks;

  package Mechanics
    package Rotational
      package Interfaces
        connector Flange_a
          Real phi(unit="rad");
          flow Real tau(unit="N.m");
        end Flange_a;
        connector Flange_b
          Real phi(unit="rad");
          flow Real tau(unit="N.m");
        end Flange_b;
      end Interfaces;
      package Components
        model Inertia
          parameter Real J(unit="kg.m2") = 1;
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
          Real phi(unit="rad");
          Real w(unit="rad/s");
        equation
          phi = flange_a.phi;
          phi = flange_b.phi;
          w = der(phi);
          J*der(w) = flange_a.tau + flange_b.tau;
        end Inertia;
        model SpringDamper
          parameter Real c(unit="N.m/rad") = 1e5;
          parameter Real d(unit="N.m.s/rad") = 0;
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
          Real tau(unit="N.m");
          Real phi_rel(unit="rad");
        equation
          phi_rel = flange_b.phi - flange_a.phi;
          tau = c*phi_rel + d*(der(flange_b.phi) - der(flange_a.phi));
          flange_b.tau = tau;
          flange_a.tau = -tau;
        end SpringDamper;
      end Components;
      package Sources
        model Torque
          Interfaces.Flange_b flange;
          Blocks.Interfaces.RealInput tau;
        equation
          flange.tau = -tau;
        end Torque;
      end Sources;
    end Rotational;
  end Mechanics;

  package Electrical
    package Analog
      package Interfaces
        connector PositivePin
          Real v(unit="V");
          flow Real i(unit="A");
        end PositivePin;
        connector NegativePin
          Real v(unit="V");
          flow Real i(unit="A");
        end NegativePin;
      end Interfaces;
      package Basic
        model Ground
          Interfaces.PositivePin p;
        equation
          p.v = 0;
        end Ground;
        model Resistor
          parameter Real R(unit="Ohm") = 1;
          Interfaces.PositivePin p;
          Interfaces.NegativePin n;
        equation
          p.v - n.v = R*p.i;
          0 = p.i + n.i;
        end Resistor;
        model Capacitor
          parameter Real C(unit="F") = 1;
          Real v(unit="V");
          Interfaces.PositivePin p;
          Interfaces.NegativePin n;
        equation
          v = p.v - n.v;
          p.i = C*der(v);
          0 = p.i + n.i;
        end Capacitor;
      end Basic;
      package Sources
        model ConstantVoltage
          parameter Real V(unit="V") = 1;
          Interfaces.PositivePin p;
          Interfaces.NegativePin n;
        equation
          V = p.v - n.v;
          0 = p.i + n.i;
        end ConstantVoltage;
      end Sources;
    end Analog;
  end Electrical;

  package Thermal
    package HeatTransfer
      package Interfaces
        connector HeatPort_a
          Real T(unit="K");
          flow Real Q_flow(unit="W");
        end HeatPort_a;
        connector HeatPort_b
          Real T(unit="K");
          flow Real Q_flow(unit="W");
        end HeatPort_b;
      end Interfaces;
      package Sources
        model FixedTemperature
          parameter Real T(unit="K") = 293.15;
          Interfaces.HeatPort_b port;
        equation
          port.T = T;
        end FixedTemperature;
      end Sources;
    end HeatTransfer;
  end Thermal;
end Modelica;
