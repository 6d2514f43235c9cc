% Load step of 2 N.m at standstill in Simulink (not run by us).
%
%   cargo run --release -- build
%   >> addpath('target/fmu/fmi3'), run('examples/simulink_pair.m')
%
% A block holds its inputs over a communication step and shows its outputs at its end: timing.delay stays 1.
% Set parameters other than the start values in the blocks' dialogs.

T_s = 1e-4;                                   % s: the controller's sample period
m = 'sensorless_pair';
new_system(m), open_system(m)
set_param(m, 'SolverType', 'Fixed-step', 'Solver', 'FixedStepDiscrete', 'FixedStep', num2str(T_s), 'StopTime', '3')

fmus = {'PmsmPlant', 'SensorlessController'};
for k = 1:2
    block = [m '/' fmus{k}];
    add_block('simulink_extras/FMU Import/FMU', block, 'Position', [100 + 400*(k - 1), 100, 340 + 400*(k - 1), 500])
    set_param(block, 'FMUName', [fmus{k} '.fmu'])          % the bare name: the folder is on the path
    set_param(block, 'FMUInputMapping', 'Flat', 'FMUOutputMapping', 'Flat', 'FMUSampleTime', num2str(T_s))
end
add_block('simulink/Sources/Step', [m '/tau_load'], 'Time', '0.5', 'After', '2', 'SampleTime', num2str(T_s))

% Ports are in the order of the inputs and outputs of the description: documentation/index.html lists them.
plant = {'u_a', 'u_b', 'u_c', 'u_dc', 'tau_load'};
controller = {'i_a', 'i_b', 'i_c', 'u_dc', 'speed_ref', 'theta_meas', 'speed_meas'};
for k = 1:3
    add_line(m, sprintf('SensorlessController/%d', k), sprintf('PmsmPlant/%d', k))        % u_a, u_b, u_c
    add_line(m, sprintf('PmsmPlant/%d', k), sprintf('SensorlessController/%d', k))        % i_a, i_b, i_c
end
add_line(m, 'tau_load/1', sprintf('PmsmPlant/%d', find(strcmp(plant, 'tau_load'))))
sources = {'PmsmPlant', plant, 'u_dc', '325'; 'SensorlessController', controller, 'u_dc', '325'; ...
           'SensorlessController', controller, 'speed_ref', '0'};
for k = 1:size(sources, 1)
    [block, ports, port, value] = sources{k, :};
    name = [block '_' port];
    add_block('simulink/Sources/Constant', [m '/' name], 'Value', value, 'SampleTime', num2str(T_s))
    add_line(m, [name '/1'], sprintf('%s/%d', block, find(strcmp(ports, port))))
end
